"""The demonstration's circles with LinuxCNC as the control: `python -m tests.control.through_the_bar FOLDER`.

LinuxCNC runs the nominal programs on the generated kinematics; the virtual machine follows the joints that it drives, and a bar
measures it through serial line and station, as in `dbbstation demo`. Needs what `test_in_linuxcnc.py` needs.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.demo import QUICK, _Job, _write_plan, _write_truth
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import read_model
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.shipped import shipped_folder
from dbbstation.machine.kinematics import forward
from dbbstation.machine.rotation import Frames
from tests.control.in_linuxcnc import installed, our_kins
from tests.nc.planner.linuxcnc import run

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from tests.nc.planner.linuxcnc import Ran

MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"

EVERY = 20
"""Servo cycles between points of a driven path: a chord of half a micrometre at 25 mm/s on a circle of 150 mm has 24 mm."""


def driven_program(machine: Machine, ran: Ran) -> str:
    """Return the program by which a nominal control would drive the struts as LinuxCNC drove them."""
    rows = np.unique([*range(0, len(ran.poses), EVERY), len(ran.poses) - 1])
    middle = np.array([[0.0, 0.0, sum(machine.travel.z_mm) / 2.0, 0.0, 0.0, 0.0]])
    near = Frames.from_poses(np.repeat(middle, len(rows), axis=0), machine.hexapod.rotation)
    frames = forward(machine.hexapod, ran.poses[rows] + machine.reference_length_error_mm, near)
    poses, time_s = frames.to_poses(machine.hexapod.rotation), ran.time_s[rows]
    way, took = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1), np.diff(time_s)
    lines = [f"G0 {_words(poses[0])}"]
    lines += [
        f"G1 {_words(pose)} F{60.0 * mm / s:.6f}" for pose, mm, s in zip(poses[1:], way, took, strict=True) if mm > 0.0
    ]
    return "\n".join(["%", "G21 G90 G94", *lines, "M2", "%", ""])


def _words(pose: np.ndarray) -> str:
    return " ".join(f"{axis}{value:.6f}" for axis, value in zip("XYZABC", pose, strict=True))


def measured(folder: Path, seed: int = 3) -> dict[str, dict[str, float]]:
    """Measure the quick plan under the generated kinematics; return figures of each circle [µm]."""
    folder.mkdir(parents=True)
    plan = _write_plan(folder / "plan.yaml", read_inline_plan(PLAN), QUICK)
    _write_truth(folder / "truth.yaml", MACHINE, seed)
    machine = read_machine(MACHINE)
    what = ["--plan", str(plan.resolve()), "--machine"]
    nominal = _Job(folder, [*what, str(MACHINE)], print, lambda *_: None)
    corrected = _Job(folder, [*what, "dbbkins.machine.yaml"], print, lambda *_: None)
    nominal.answer(["control", "kinematics", "--model", "truth.yaml", "--out", "dbbkins.comp"])
    nominal.answer(["program", *nominal.what, "--dialect", "linuxcnc", "--bar-stays-on", "--out", "programs"])
    (folder / "driven").mkdir()
    module = installed(read_model(folder / "truth.yaml").model, folder)
    try:
        for program in sorted((folder / "programs").glob("*.ngc")):
            ran = run(program.read_text(), faster=4, kins=our_kins(machine))
            (folder / "driven" / program.name).write_text(driven_program(machine, ran))
    finally:
        module.unlink()
    with nominal.emulated(["--truth", "truth.yaml", "--seed", str(seed), "--programs", "driven"]) as place:
        corrected.measure(place, "verified", ["--programs", "programs"])
    found = json.loads(nominal.answer(["evaluate", "verified", "--model", "truth.yaml"]))
    return {
        f"{one['test']} {one['direction']}": {**one["measured"], "left_by_the_model": one["after"]["circularity_um"]}
        for one in found["runs"]
    }


if __name__ == "__main__":
    for name, figures in measured(Path(sys.argv[1])).items():
        sys.stdout.write(f"{name}: {figures}\n")
