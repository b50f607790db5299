"""What a generated kinematics costs beside LinuxCNC's genhexkins: `python -m benchmarks.kinematics`.

Both run in one C program on the same 100,000 poses: genhexkins as it is installed, with HAL's functions imitated and the nominal joints,
and the component of a model with joints, lengths, gravity, lead and cyclic errors. Forward begins a millimetre away.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np

from dbbstation.control.kinematics import component
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import package_text, shipped_folder
from tests.control.machines import poses
from tests.control.test_parameters import truth_of

POSES = 100_000

HARNESS = """
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
%s
#include <emcpos.h>
static char names[256][64]; static double *values[256]; static int pins;
int hal_init(const char *name) { return 1; }
int hal_ready(int id) { return 0; }
int hal_exit(int id) { return 0; }
void *hal_malloc(long size) { return calloc(1, size); }
void rtapi_print(const char *text, ...) { }
void rtapi_print_msg(int level, const char *text, ...) { }
static int pin(void **at) { *at = calloc(1, 8); return 0; }
int hal_pin_bit_new(const char *n, int d, void **at, int c) { return pin(at); }
int hal_pin_s32_new(const char *n, int d, void **at, int c) { return pin(at); }
int hal_pin_bit_newf(int d, void **at, int c, const char *f, ...) { return pin(at); }
int hal_pin_u32_newf(int d, void **at, int c, const char *f, ...) { return pin(at); }
int hal_pin_float_newf(int d, void **at, int c, const char *f, ...)
{
    va_list more; va_start(more, f); vsnprintf(names[pins], 64, f, more); va_end(more);
    pin(at); values[pins++] = *at; return 0;
}
static void set(const char *name, double value) { for (int k = 0; k < pins; k++) if (!strcmp(names[k], name)) *values[k] = value; }
static double now(void) { struct timespec t; clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }
int main(int n, char **v)
{
    static double pose[%d][6], joint[%d][6];
    FILE *f = fopen(v[1], "rb"); size_t got = fread(pose, sizeof pose, 1, f); fclose(f);
    void *lib = dlopen("/usr/lib/linuxcnc/modules/genhexkins.so", RTLD_NOW);
    if (!got || !lib) { fprintf(stderr, "%%s\\n", dlerror()); return 1; }
    int (*begin)(void) = dlsym(lib, "rtapi_app_main");
    int (*inverse)(const EmcPose *, double *, void *, void *) = dlsym(lib, "kinematicsInverse");
    int (*forward)(const double *, EmcPose *, void *, void *) = dlsym(lib, "kinematicsForward");
    if (begin()) return 1;
    char name[64];
    ALL { snprintf(name, 64, "genhexkins.base.%%d.%%c", i, 'x' + k); set(name, Q[i][k]);
          snprintf(name, 64, "genhexkins.platform.%%d.%%c", i, 'x' + k); set(name, P[i][k]); }
    long flags[2] = {0}; int most = 0, wrong = 0; double t = now();
    for (int k = 0; k < %d; k++) {
        EmcPose e = {{pose[k][0], pose[k][1], pose[k][2]}, pose[k][3], pose[k][4], pose[k][5]};
        wrong += inverse(&e, joint[k], flags, flags + 1) != 0;
    }
    printf("genhexkins inverse %%.2f us, refused %%d\\n", (now() - t) * 1e6 / %d, wrong); t = now(), wrong = 0;
    for (int k = 0; k < %d; k++) {
        EmcPose e = {{pose[k][0] + 1.0, pose[k][1], pose[k][2]}, pose[k][3], pose[k][4], pose[k][5]};
        wrong += forward(joint[k], &e, flags, flags + 1) != 0;
    }
    printf("genhexkins forward %%.2f us, refused %%d\\n", (now() - t) * 1e6 / %d, wrong); t = now(), wrong = 0;
    for (int k = 0; k < %d; k++) wrong += dbb_inverse(pose[k], joint[k]) != 0;
    printf("generated  inverse %%.2f us, refused %%d\\n", (now() - t) * 1e6 / %d, wrong); t = now(), wrong = 0;
    for (int k = 0; k < %d; k++) {
        double e[6]; memcpy(e, pose[k], sizeof e); e[0] += 1.0;
        wrong += dbb_forward(joint[k], e) != 0;
        if (rounds > most) most = rounds;
    }
    printf("generated  forward %%.2f us, refused %%d, at most %%d rounds\\n", (now() - t) * 1e6 / %d, wrong, most);
    return 0;
}
"""


def main() -> None:
    """Print processor time per call of both."""
    of = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    made = component(truth_of(of, "gravity", "screw-lead", "screw-cyclic"), package_text, "dbbkins", "0" * 64)
    with tempfile.TemporaryDirectory() as folder:
        source, program, given = (Path(folder) / name for name in ("cost.c", "cost", "poses"))
        source.write_text(HARNESS % (made.mathematics, *[POSES] * 10))
        given.write_bytes(np.ascontiguousarray(poses(of, POSES, 1)).tobytes())
        flags = ["-O2", "-rdynamic", "-I/usr/include/linuxcnc", "-DULAPI", "-w"]
        command = ["gcc", *flags, str(source), "-o", str(program), "-lm", "-ldl"]
        subprocess.run(command, check=True)  # noqa: S603 - built here
        subprocess.run([str(program), str(given)], check=True)  # noqa: S603 - likewise


if __name__ == "__main__":
    main()
