"""Generated C, compiled by gcc and called from Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from typing import TYPE_CHECKING

import numpy as np

from tests.nc.planner.required import needs

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from dbbstation.control.kinematics import Component

COMPILER = needs("" if shutil.which("gcc") else "there is no gcc")

_AROUND = """
#include <math.h>
{mathematics}
void warm(const double *kelvin) {{ for (unsigned k = 0; k < sizeof warmer / sizeof *warmer; k++) warmer[k] = kelvin[k]; }}
void switched(int k, int on) {{ use[k] = on; }}
int most_rounds;
void inverse(int n, const double *pose, double *joint, int *wrong)
{{
    for (int k = 0; k < n; k++) {{
        wrong[k] = dbb_inverse(pose + 6 * k, joint + 6 * k);
        if (rounds > most_rounds) most_rounds = rounds;
    }}
}}
void forward(int n, const double *joint, double *pose, int *wrong)
{{
    for (int k = 0; k < n; k++) {{
        wrong[k] = dbb_forward(joint + 6 * k, pose + 6 * k);
        if (rounds > most_rounds) most_rounds = rounds;
    }}
}}
"""


class Compiled:
    """The mathematics of a component as a library."""

    def __init__(self, made: Component, folder: Path) -> None:
        source, library = folder / "kins.c", folder / "kins.so"
        source.write_text(_AROUND.format(mathematics=made.mathematics))
        flags = ["-O2", "-Wall", "-Werror", "-Wno-unused-const-variable", "-fPIC", "-shared"]
        subprocess.run(["gcc", *flags, str(source), "-o", str(library), "-lm"], check=True)  # noqa: S607
        self.library = ctypes.CDLL(str(library))

    def warm(self, kelvin: NDArray[np.float64]) -> None:
        self.library.warm(_pointer(np.ascontiguousarray(kelvin)))

    def inverse(self, poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        return self._called(self.library.inverse, poses, np.zeros_like(poses))

    def forward(
        self, joints: NDArray[np.float64], near: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        return self._called(self.library.forward, joints, near.copy())

    @property
    def most_rounds(self) -> int:
        return ctypes.c_int.in_dll(self.library, "most_rounds").value

    def _called(
        self, function: ctypes._CFuncPtr, given: NDArray[np.float64], answer: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        wrong = np.zeros(len(given), dtype=np.int32)
        function(len(given), _pointer(np.ascontiguousarray(given)), _pointer(answer), _pointer(wrong))
        return answer, wrong


def _pointer(array: NDArray[np.generic]) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)
