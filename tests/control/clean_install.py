"""Install a generated component on a LinuxCNC as the package leaves it: `python -m tests.control.clean_install`, as root.

Prints the transcript of docs/control.md. The configuration is LinuxCNC's own example `hexapod-sim`, with the lines that the
command prints; a script that homes and moves takes the place of its screen.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from dbbstation.demo.in_control import home_mm_of
from dbbstation.files.formats.machine import read_machine
from dbbstation.virtual.linuxcnc import MODULES, NOBODY, alone

EXAMPLE = Path("/usr/share/doc/linuxcnc/examples/sample-configs/sim/axis/vismach/hexapod-sim/hexapod.ini")
SHOP = "/usr/bin:/bin:" + os.environ["PATH"]

SCREEN = """#!/usr/bin/python3
import subprocess, sys, time
import linuxcnc
command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()
def until(reached):
    end = time.monotonic() + 20
    while time.monotonic() < end and not reached():
        time.sleep(0.01); status.poll()
def show(what):
    status.poll()
    place = " ".join(f"{axis}{value:.4f}" for axis, value in zip("XYZABC", status.position))
    print(f"{what}: {place}; joint 0 {status.joint_actual_position[0]:.4f}", flush=True)
status.poll()
for state in (linuxcnc.STATE_ESTOP_RESET, linuxcnc.STATE_ON):
    command.state(state); command.wait_complete()
until(lambda: status.enabled)
for joint in range(6):
    command.home(joint)
until(lambda: all(status.homed[:6]))
print("homed:", all(status.homed[:6]), flush=True)
show("after homing")
command.mode(linuxcnc.MODE_MDI); command.wait_complete()
command.mdi("G21 G90 G0 X50 Y-20 Z-1000 A5 B-5")
command.wait_complete(20)
time.sleep(0.5)
until(lambda: status.interp_state == linuxcnc.INTERP_IDLE and status.inpos)
show("after G0 X50 Y-20 Z-1000 A5 B-5")
for pin in ("model", "fault", "iterations", "correction-0"):
    done = subprocess.run(["halcmd", "getp", f"KINS.{pin}"], capture_output=True, text=True)
    if done.returncode == 0:
        print(f"KINS.{pin} = {done.stdout.strip()}", flush=True)
while (told := errors.poll()) is not None:
    if "homed before" not in told[1]:
        print("LinuxCNC says:", told[1], flush=True)
"""


def shown(command: str, folder: Path, *, user: bool = False) -> str:
    """Run a command and print both."""
    sys.stdout.write(f"$ {command}\n")
    words = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"] if user else []
    done = subprocess.run(
        [*words, "sh", "-c", command.removeprefix("sudo ")],
        cwd=folder,
        env={**os.environ, "PATH": SHOP, "HOME": str(folder)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    printed = done.stdout if done.returncode == 0 else done.stdout + done.stderr
    sys.stdout.write(printed)
    return printed


def configured(ini: str, printed: str, home: np.ndarray) -> str:
    """The example's INI file with the lines that the command printed, in millimetres and without screens."""
    kins = re.search(r"KINEMATICS = (\w+)", printed)[1]
    low, high = (re.search(rf"{name}_LIMIT = (\S+)", printed)[1] for name in ("MIN", "MAX"))
    ini = re.sub(
        r"(?m)^(PYVCP|POSTGUI_HALFILE|HALCMD|HALUI|INTRO.*?|MDI_COMMAND|.*REMAP|HALFILE = kinematics).*\n", "", ini
    )
    ini = ini.replace("DISPLAY = axis", "DISPLAY = ./screen").replace("LINEAR_UNITS = inch", "LINEAR_UNITS = mm")
    ini = ini.replace("G20", "G21").replace("HOME = 0 0 20 0 0 0", "HOME = 0 0 -1008 0 0 0")
    ini = ini.replace("KINEMATICS = genhexkins", f"KINEMATICS = {kins}")
    ini = ini.replace(
        "LIB:basic_sim.tcl\n",
        f"LIB:basic_sim.tcl -no_use_hal_manualtoolchange\nHALCMD = net sample:enable => {kins}.enabled\n",
    )
    parts = re.split(r"(?m)^(?=\[JOINT_\d\])", ini.replace("-1000.0", "-9999").replace("1000.0", "9999"))
    for i, length in enumerate(home):
        parts[i + 1] = re.sub(
            r"HOME_OFFSET=.*\nHOME = .*", f"HOME_OFFSET = {length:.6f}\nHOME = {length:.6f}", parts[i + 1]
        )
        own = parts[i + 1].partition("[AXIS_X]")
        parts[i + 1] = own[0].replace("-9999", low).replace("9999", high) + own[1] + own[2]
    return "".join(parts)


def main() -> None:
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        shown("dbbstation settings shipped examples --out shop", folder)
        shop = folder / "shop"
        printed = shown("dbbstation control kinematics --model model.yaml --out dbbkins.comp", shop)
        if (MODULES / "dbbkins.so").exists():
            raise SystemExit("a dbbkins is installed already")
        shown("sudo halcompile --install dbbkins.comp", shop)
        machine = read_machine(shop / "dbbkins.machine.yaml")
        mill = configured(EXAMPLE.read_text(encoding="utf-8"), printed, home_mm_of(machine))
        (shop / "mill.ini").write_text(mill)
        for name in ("hexapod.var", "hexapod.tbl"):
            (shop / name).touch()
        (shop / "screen").write_text(SCREEN.replace("KINS", "dbbkins"))
        (shop / "screen").chmod(0o755)
        for path in (folder, shop, *shop.rglob("*")):
            shutil.chown(path, int(NOBODY), int(NOBODY))
        with alone():
            shown("linuxcnc -r mill.ini", shop, user=True)
        shown("sudo rm /usr/lib/linuxcnc/modules/dbbkins.so", shop)


if __name__ == "__main__":
    main()
