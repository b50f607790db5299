"""A compensated circle on the plant, which shares no code with the package: with play in every strut it is true."""

from __future__ import annotations

import numpy as np

from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from tests.nc.whole import compensate_toolpath
from tests.plant.hexapod import strut_lengths
from tests.plant.machine import reference_machine
from tests.plant.mechanisms.play_operator import follower

GAPS_UM = np.array([3.0, 5.0, 2.0, 4.0, 6.0, 1.0])
STEP_MM = 0.05


def driven(path):
    """Poses every 50 µm along the program, and whether they lie on the arc."""
    row, share = path.subdivided(STEP_MM, 0.002)
    known = ~np.isnan(path.before[row][:, 0]) & path.is_move[row]
    row, share = row[known], share[known]
    longest = np.flatnonzero(path.kind == RowKind.FEED)
    middle = longest[len(longest) // 2]
    stops = np.flatnonzero(path.kind == RowKind.DWELL)
    arc = (row > stops[stops < middle][-1]) & (row < stops[stops > middle][0])
    return path.between(row, share), arc


def on_the_plant(poses):
    """Where the plant's tool goes, shape (n, 3): each strut follows through its play, Newton's method for the pose."""
    machine = reference_machine()
    length = strut_lengths(machine, poses)
    reached = np.column_stack([follower(length[:, i], GAPS_UM[i] / 2000.0) for i in range(6)])
    found, steps = poses.copy(), np.diag([1e-4, 1e-4, 1e-4, 1e-5, 1e-5, 1e-5])
    for _ in range(3):
        slopes = [
            (strut_lengths(machine, found + h) - strut_lengths(machine, found - h)) / (2 * h.max()) for h in steps
        ]
        missing = reached - strut_lengths(machine, found)
        found = found + np.linalg.solve(np.stack(slopes, axis=2), missing[:, :, None])[:, :, 0]
    assert np.abs(reached - strut_lengths(machine, found)).max() < 1e-9
    return found[:, :3]


def test_a_circle_is_true_on_the_plant(table2, reference):
    model = MachineModel(reference, (Fitted(known_sources()["backlash"], GAPS_UM),))
    planned = table2.tests["b"]
    circle = planned.run(planned.directions[0])
    nominal = circle_toolpath(circle, "b")
    done = compensate_toolpath(nominal, model)
    centre = np.mean([circle.poses(np.array([0.0])), circle.poses(np.array([180.0]))], axis=0)[0, :3]
    off_um = {}
    for name, path in (("nominal", nominal), ("compensated", done.toolpath)):
        poses, arc = driven(path)
        place = on_the_plant(poses)[arc] - centre
        off_um[name] = 1e3 * np.column_stack([np.hypot(*place[:, :2].T) - circle.radius_mm, place[:, 2]])
    assert np.ptp(off_um["nominal"][:, 0]) > 5.0
    off = np.abs(off_um["compensated"]).max(axis=1)
    # What is left lies where a strut turns round: the command crosses the play within 0.05 mm, fifteen times in 450 degrees.
    beyond_mm = STEP_MM * np.count_nonzero(off > 0.3)
    assert beyond_mm < 15 * 0.05
    assert np.median(off) < 0.1
