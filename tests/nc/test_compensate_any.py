"""Compensation of programs that are no circles: long lines, turns about the tip, arcs, rapids, sources with a history."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.errors import ModelError, StationError, TravelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Effect, Fitted, LinearSource, Motion, Need, Owner, Parameter, Texts
from tests.nc.whole import compensate_toolpath

PART = """\
G21 G90 G94
G64 P0.01
G0 X-100 Y0 Z-1000 A0 B0 C0
G1 X100 F1000
(a turn about a tip that stands still)
G1 A10 F120
G4 P2
G1 X0 Y50 A-5 B5 F2000
G3 X0 Y-50 I0 J-50
G0 Z-950
M2
"""


def reached(model: MachineModel, poses: np.ndarray) -> np.ndarray:
    return model.actual_poses(Motion(poses=poses, is_path=True))


def at_shares(path, count=40):
    row = np.repeat(np.flatnonzero(path.kind == RowKind.FEED), count)
    return row, np.tile(np.arange(1, count + 1) / count, len(row) // count)


def test_long_moves_are_split_until_the_tool_goes_straight(linuxcnc, crooked):
    wanted = linuxcnc.read(PART, "part.ngc")
    done = compensate_toolpath(wanted, crooked)
    assert done.chord_um < 0.1
    lines = {int(line): np.count_nonzero(done.toolpath.line == line) for line in (4, 6, 8, 10)}
    assert 4 <= lines[4] < 100
    assert lines[6] > 1
    assert lines[10] == 1
    # The tool's distance from the straight line at 40 places in each piece.
    first = done.toolpath.line == 4
    row, share = at_shares(done.toolpath)
    poses = reached(crooked, done.toolpath.between(row, share)[first[row]])
    assert np.abs(poses[:, 1:3] - [0.0, -1000.0]).max() < 0.11e-3
    assert np.abs(poses[:, 3:]).max() < 1e-4


def test_a_wider_tolerance_splits_less(linuxcnc, crooked):
    wanted = linuxcnc.read(PART, "part.ngc")
    counts = [len(compensate_toolpath(wanted, crooked, chord_mm=chord).toolpath) for chord in (1e-5, 1e-4, 1e-3)]
    assert counts[0] > counts[1] > counts[2]


def test_every_programmed_point_is_reached(linuxcnc, crooked):
    wanted = linuxcnc.read(PART, "part.ngc")
    done = compensate_toolpath(wanted, crooked).toolpath
    for line in np.unique(wanted.line[wanted.is_move]):
        last = reached(crooked, done.poses[done.line == line][-1:])[0]
        np.testing.assert_allclose(last, wanted.poses[wanted.line == line][-1], atol=2e-6)


def test_the_time_of_every_move_stays_even_where_only_the_tilt_changes(linuxcnc, crooked):
    wanted = linuxcnc.read(PART, "part.ngc")
    done = compensate_toolpath(wanted, crooked).toolpath
    again = linuxcnc.read(linuxcnc.write(done), "again.ngc")
    assert np.isfinite(again.feed_mm_min[again.kind == RowKind.FEED]).all()
    for line in (4, 6, 7, 8, 9):
        took = done.duration_s[done.line == line].sum()
        assert took == pytest.approx(wanted.duration_s[wanted.line == line].sum(), rel=2e-3)
    assert wanted.duration_s[wanted.line == 6].sum() == pytest.approx(5.0)
    assert set(done.feed_mm_min[done.line == 4]) == {1000.0}
    assert again.end_s[-1] == pytest.approx(done.end_s[-1], rel=1e-3)


def test_comments_dwells_and_path_control_stay(linuxcnc, crooked):
    text = compensated_program(linuxcnc.read(PART, "part.ngc"), linuxcnc, Inverse(crooked)).text
    assert "; a turn about a tip that stands still" in text
    assert "G4 P2" in text
    assert "G64 P0.01 Q0" in text
    assert text.splitlines()[-1].endswith("M2")


def test_nobody_compensates_twice(linuxcnc, crooked):
    once = compensated_program(linuxcnc.read(PART, "part.ngc"), linuxcnc, Inverse(crooked))
    with pytest.raises(StationError, match="compensated already"):
        compensated_program(linuxcnc.read(once.text, "once.ngc"), linuxcnc, Inverse(crooked))


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("G0 X0 Y0 Z-1000 A0 B0 C0\nG1 X310 F100\n", "part.ngc:2"),
        ("G0 X0 Y0 Z-1000 A0 B0 C0\n\nG1 A27 F100\nX5\n", "part.ngc:3"),
        ("G0 X0 Y0 Z-1000 A0 B0 C0\nG2 I0 J160 F100\nG0 X0\n", "part.ngc:2"),
    ],
)
def test_a_program_that_leaves_the_travel_is_refused_by_its_line(linuxcnc, crooked, text, where):
    with pytest.raises(TravelError) as caught:
        compensated_program(linuxcnc.read(text + "M2\n", "part.ngc"), linuxcnc, Inverse(crooked))
    assert caught.value.where.startswith(where)


def test_the_correction_itself_may_not_leave_the_travel(linuxcnc, crooked):
    edge = "G0 X0 Y0 Z-1208 A0 B0 C0\nG1 X5 F100\nM2\n"
    lifted = MachineModel(
        crooked.machine, (Fitted(crooked.sources[0].source, np.full(6, -0.2)),)
    )  # shorter struts: the command must reach lower
    with pytest.raises(TravelError):
        compensated_program(linuxcnc.read(edge, "edge.ngc"), linuxcnc, Inverse(lifted))


class Wound(LinearSource):
    """A strut is late by a fixed amount after its reversal: something with a history."""

    name = "wound"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.PATH})
    texts = Texts("", "", "", "", "", "")

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("amount_mm", "mm", 0.01, ""),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
        way = np.sign(np.diff(inverse(machine.hexapod, frames).length_mm, axis=0, prepend=np.nan))
        way[0] = 0.0
        return Effect(strut_mm=-way[:, :, None])


def test_a_step_of_the_correction_is_placed_and_not_halved_for_ever(linuxcnc, reference):
    model = MachineModel(reference, (Fitted(Wound(), np.array([0.03])),))
    text = "G21 G90\nG0 X-100 Y10 Z-1000 A0 B0 C0\nG1 X100 F1000\nM2\n"
    wanted = linuxcnc.read(text, "line.ngc")
    done = compensate_toolpath(wanted, model)
    assert len(done.toolpath) < 300
    assert done.chord_um > 0.1
    row, share = at_shares(done.toolpath, 10)
    poses = reached(model, np.vstack([done.toolpath.poses[0], done.toolpath.between(row, share)]))[1:]
    off = np.linalg.norm(poses[:, 1:3] - [10.0, -1000.0], axis=1)
    uncorrected = reached(model, wanted.between(*wanted.subdivided(1.0, 1.0)))[2:]
    assert np.median(np.linalg.norm(uncorrected[:, 1:3] - [10.0, -1000.0], axis=1)) > 1e-3
    way = done.toolpath.tip_mm[row] / 10.0
    assert way[off > 0.2e-3].sum() < 0.5


class Ageing(Wound):
    """Something that needs the time."""

    name = "ageing"
    needs = frozenset({Need.TIME})

    def derivative(self, motion, machine, values):  # noqa: ARG002
        return Effect(strut_mm=np.tile(motion.time_s[:, None, None], (1, 6, 1)))


def test_time_is_refused_by_name_unless_it_is_given(linuxcnc, reference):
    model = MachineModel(reference, (Fitted(Ageing(), np.array([1e-4])),))
    wanted = linuxcnc.read("G21 G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F1000\nG4 P2\nG1 X90\nM2\n", "line.ngc")
    with pytest.raises(ModelError, match="ageing needs time"):
        compensate_toolpath(wanted, model)
    done = compensate_toolpath(wanted, model, started_s=100.0).toolpath
    # All struts 0.1 µm longer for each second: the command is that much higher, 10 µm and more.
    end = done.poses[-1]
    expected_s = 100.0 + wanted.end_s[-1]
    row = inverse(reference.hexapod, Frames.from_poses(np.vstack([end, wanted.poses[-1]]), reference.hexapod.rotation))
    np.testing.assert_allclose(row.length_mm[0] - row.length_mm[1], -1e-4 * expected_s, atol=2e-6)
