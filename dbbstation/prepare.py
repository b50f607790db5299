"""Compile the numerical loops for this computer: `python -m dbbstation.prepare`.

Otherwise the first command compiles them, which takes seconds.
"""

from __future__ import annotations

import numpy as np

from dbbstation.circles.extremes import drawn_paths
from dbbstation.circles.form import form_and_noise
from dbbstation.circles.strip import strip_widths
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.dialects.linuxcnc import LinuxCNC
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.rs274.reader import read_program
from dbbstation.sources.contract import Fitted, Motion, Setup
from dbbstation.sources.registry import known_sources
from dbbstation.sources.trial import tried


def prepare() -> None:
    """Call all compiled functions, on a few poses.

    Raises:
        InputError: the installation is not complete.
    """
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")
    for source in known_sources().values():
        tried(source, machine)
    joints = Fitted.zero(known_sources()["base-joints"], machine)
    model = MachineModel(machine, (joints,))
    middle = np.array([0.0, 0.0, sum(machine.travel.z_mm) / 2.0, 0.0, 0.0, 0.0])
    ball = Setup("", "", "", "", middle[:3], 0.0, 0.0, 0.0)
    motion = Motion(np.tile(middle, (3, 1)) + np.arange(3.0)[:, None], is_path=True, setup=ball)
    for one in (MachineModel(machine), model):
        one.actual(motion)
        one.bar(motion).by_source(joints.source, machine, joints.values)
    place = "X0 Y0 Z{:.3f} A0 B0 C0"
    lines = ["G21 G90 G94 F600", f"G0 {place}", *(f"G1 X{x}" for x in range(8)), "M2"]
    program = "\n".join(lines).format(middle[2])
    compensated_program(read_program(program, "prepared.ngc"), LinuxCNC(), Inverse(model))
    noise = form_and_noise(np.random.default_rng(1).standard_normal(128))
    for path in drawn_paths(noise, np.arange(128.0) * (360.0 / 128.0), np.ones(65), 1, (2, 0)):
        strip_widths(path.highest_um, path.lowest_um, path.theta_deg)


if __name__ == "__main__":
    prepare()
