"""Four ways to correct one machine, driven by LinuxCNC: `python -m tests.control.four_ways [--store]`.

A virtual machine with hidden errors follows the joints that LinuxCNC drives; the model that corrects is the machine itself, so that
what is left is the way's. Needs what `test_in_linuxcnc.py` needs.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.control.parameters import FITTED, TRIED, drawn_poses, refitted, tool_errors
from dbbstation.demo.in_control import genhexkins, made_kins
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.places import shipped_folder
from dbbstation.machine.geometry import Frames, Hexapod, Rotation
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.tasks.compensate import compensate
from dbbstation.virtual.linuxcnc import ControlKins, PlannerRun, run
from tests.control.in_linuxcnc import NAME, circle_of, circle_program, installed
from tests.control.test_parameters import HIGH, LOW, truth_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

STORED = Path(__file__).parents[2] / "docs" / "validation" / "control-ways.json"

FASTER, RADIUS_MM, FEED = 4, 75.0, 1500.0
CIRCLES = {"upright": (0.0, 0.0), "A10 B10": (10.0, 10.0), "A-12 B5": (-12.0, 5.0)}
Z_MM = -1008.0

EVERY = 20
"""Servo cycles between places of the part that are looked at."""

PART = """G21 G90 G94
G64 P0.001
G0 X-60 Y-40 Z-1000 A5 B-4 C0
G1 X60 F1500
G1 Y40 A-5
G1 X-60 B4 Z-1010
G1 Y-40
M2
"""


def machine_model() -> MachineModel:
    """The reference machine with genhexkins' order of rotation, joints, lengths, gravity, lead and cyclic errors."""
    of = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    of = replace(of, hexapod=Hexapod(of.hexapod.base_joints_mm, of.hexapod.platform_joints_mm, Rotation.ZYX))
    return truth_of(of, "gravity", "screw-lead", "screw-cyclic")


def part_um(model: MachineModel, ran: PlannerRun, plain: PlannerRun) -> float:
    """Greatest distance of the tool from the path that LinuxCNC without kinematics goes [µm]."""
    at = Frames.from_poses(plain.poses, model.machine.hexapod.rotation)
    middle = Frames.from_poses(
        np.tile([0.0, 0.0, Z_MM, 0.0, 0.0, 0.0], (len(ran.poses), 1)), model.machine.hexapod.rotation
    )
    tips = middle.position_mm + tool_errors(model, ran.poses, middle)[:, :3]
    path = at.position_mm
    worst = 0.0
    for tip in tips[::EVERY]:
        k = min(max(int(np.argmin(np.sum((path - tip) ** 2, axis=1))), 1), len(path) - 2)
        worst = max(worst, min(_beside(tip, path[k - 1], path[k]), _beside(tip, path[k], path[k + 1])))
    return 1e3 * worst


def _beside(tip: NDArray[np.float64], one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return a point's distance from a piece of a path."""
    way = other - one
    share = np.clip((tip - one) @ way / max(float(way @ way), 1e-30), 0.0, 1.0)
    return float(np.linalg.norm(tip - one - share * way))


def compensated_text(model: MachineModel, text: str, folder: Path) -> str:
    rows = tuple((f.source.name, "", p.name) for f in model.sources for p in f.source.parameters(model.machine))
    write_model(folder / "model.yaml", IdentifiedModel(model, rows, np.zeros((len(rows), len(rows)))), force=True)
    (folder / "part.ngc").write_text(text)
    return compensate(folder / "part.ngc", folder / "model.yaml", chord_um=0.5).programs[0].text


def measured(model: MachineModel, kins: ControlKins, *, program: bool, folder: Path) -> list[str]:
    """Return cells of one way: per circle centre, roundness and tilt; the part; time over that without kinematics."""
    cells, took, plainly = [], 0.0, 0.0
    for tilt in CIRCLES.values():
        text = circle_program(RADIUS_MM, tilt, FEED, Z_MM)
        plainly += run(text, faster=FASTER).duration_s
        ran = run(compensated_text(model, text, folder) if program else text, faster=FASTER, kins=kins)
        took += ran.duration_s
        found = circle_of(model, ran, np.array([0.0, 0.0, Z_MM, *tilt, 0.0]), RADIUS_MM)
        off = np.linalg.norm(found.centre_um)
        cells.append(f"{off:.2f} / {found.roundness_um:.2f} / {found.tilt_deg:.5f}")
    plain = run(PART, faster=FASTER)
    ran = run(compensated_text(model, PART, folder) if program else PART, faster=FASTER, kins=kins)
    return [
        *cells,
        f"{part_um(model, ran, plain):.2f}",
        f"{(took + ran.duration_s) / (plainly + plain.duration_s):.4f}",
    ]


def main() -> None:
    model = machine_model()
    of = model.machine
    values = refitted(model, drawn_poses(LOW, HIGH, FITTED, 1), drawn_poses(LOW, HIGH, TRIED, 2)).values
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        with installed(model, folder):
            figures = {
                "nominal": measured(model, genhexkins(of, None), program=False, folder=folder),
                "program": measured(model, genhexkins(of, None), program=True, folder=folder),
                "parameters": measured(model, genhexkins(of, values), program=False, folder=folder),
                "kinematics": measured(model, made_kins(of, NAME), program=False, folder=folder),
            }
    kept = {
        "question": "How well do four ways correct one machine under LinuxCNC?",
        "data": "Circles of 75 mm at F1500, and a part of four lines with tilts; LinuxCNC drives the joints of a virtual machine with "
        "hidden errors, and the model that corrects is the machine's own. Circles: centre / roundness [µm] / largest tilt [deg].",
        "command": "python -m tests.control.four_ways --store",
        "date": datetime.now(UTC).date().isoformat(),
        "seed": 6,
        "columns": [*CIRCLES, "part / µm", "time over LinuxCNC without kinematics"],
        "figures": figures,
        "limits": "No bar, no noise: a bar's noise is the same in all ways. Play and friction are not in this machine.",
    }
    text = json.dumps(kept, indent=2, ensure_ascii=False) + "\n"
    if "--store" in sys.argv:
        STORED.write_text(text, encoding="utf-8")
    sys.stdout.write(text)


if __name__ == "__main__":
    main()
