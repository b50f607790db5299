"""Which pieces are chosen: against all ways to cut a short curve, and against closed forms."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from dbbstation.errors import StationError
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.curve import felt_mm
from dbbstation.nc.dialects.linuxcnc import LinuxCNC
from dbbstation.nc.export import Inverse, compensated_program, planner_of
from dbbstation.nc.planner import LookAhead, Planner
from dbbstation.nc.splitting import longest
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Effect, Fitted, LinearSource, Motion, Need, Owner, Parameter, Texts
from tests.nc.test_compensate_any import Wound
from tests.nc.whole import compensate_toolpath

SLOW = Planner(1000.0, LookAhead(0.5))


def distance(way, curve, start, end):
    share = (way[start : end + 1] - way[start]) / (way[end] - way[start])
    off = curve[start : end + 1] - curve[start] - share[:, None] * (curve[end] - curve[start])
    return max(np.linalg.norm(off[:, :3], axis=1).max(), np.linalg.norm(off[:, 3:], axis=1).max())


def every_cut(count):
    for number in range(count - 1):
        for inner in combinations(range(1, count - 1), number):
            yield (0, *inner, count - 1)


def drawn(seed, count=9):
    rng = np.random.default_rng(seed)
    way = np.concatenate([[0.0], np.cumsum(rng.uniform(0.2, 2.0, count - 1))])
    curve = np.cumsum(rng.normal(0.0, 0.1, (count, 6)), axis=0)
    return way, curve


@pytest.mark.parametrize("seed", range(12))
def test_pieces_keep_the_tolerance_and_are_nearly_as_few_as_any_cut_allows(seed):
    way, curve = drawn(seed)
    tolerance = 0.15
    may_end, must_end = np.ones(len(way), dtype=bool), np.arange(len(way)) == len(way) - 1
    ended = (0, *longest(way, curve, may_end, must_end, tolerance).tolist())
    pieces = list(pairwise(ended))
    # Neighbours may always be joined: there is nothing between them.
    assert all(distance(way, curve, a, b) <= tolerance for a, b in pieces)
    fewest = min(
        len(cut) - 1
        for cut in every_cut(len(way))
        if all(distance(way, curve, a, b) <= tolerance for a, b in pairwise(cut))
    )
    # A part of a good piece may be worse than the piece: one more is allowed for that.
    assert len(pieces) <= fewest + 1


def test_straight_moves_of_a_machine_without_errors_are_written_as_they_are(linuxcnc, reference):
    """Of one, two and three cells, and one that is too short to bend; the last turns back, so that it is no run with the others."""
    path = linuxcnc.read("G21 G90\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X80 F600\nX80.4\nX-39.6\nY20\nM2\n", "lines.ngc")
    done = compensate_toolpath(path, MachineModel(reference), chord_mm=0.001)
    np.testing.assert_allclose(done.toolpath.poses[done.toolpath.is_move], path.poses[path.is_move], atol=1e-6)


@pytest.mark.parametrize("chord_um", [0.01, 0.1, 1.0, 10.0])
def test_the_chord_error_is_that_of_arc_and_compensation_together(linuxcnc, reference, chord_um):
    """Without errors of the machine the chord of an arc remains: L = sqrt(8 r c), at most a sixth shorter."""
    path = linuxcnc.read("G21 G90\nG0 X50 Y0 Z-1000 A0 B0 C0\nG3 I-50 F600\nM2\n", "arc.ngc")
    done = compensate_toolpath(path, MachineModel(reference), chord_mm=chord_um / 1e3)
    arc = done.toolpath.kind == RowKind.FEED
    fewest = 2.0 * np.pi * 50.0 / np.sqrt(8.0 * 50.0 * chord_um / 1e3)
    assert fewest < np.count_nonzero(arc) < 1.2 * fewest
    points = done.toolpath.between(np.repeat(np.flatnonzero(arc), 50), np.tile(np.arange(50) / 50.0, arc.sum()))
    off_um = 1e3 * np.abs(np.hypot(points[:, 0], points[:, 1]) - 50.0).max()
    assert off_um == pytest.approx(done.chord_um, abs=0.02 * chord_um + 0.001)
    assert off_um <= chord_um


class Wave(LinearSource):
    """All struts longer and shorter as the tip goes along X, with a period that is not said."""

    name = "wave"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.POSE})
    texts = Texts("", "", "", "", "", "")
    detail_mm = 1e9

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("amount_mm", "mm", 0.01, ""),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        wave = np.sin(2.0 * np.pi * motion.poses[:, 0] / 25.0)
        return Effect(strut_mm=np.tile(wave[:, None, None], (1, 6, 1)))


def test_what_is_reported_is_looked_for_at_many_places(linuxcnc, reference):
    """A wave whose zeros are at begin, middle and end of each cell that is looked at first: 50 mm of 25 mm."""
    model = MachineModel(reference, (Fitted(Wave(), np.array([0.01])),))
    path = linuxcnc.read("G21 G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F600\nM2\n", "line.ngc")
    done = compensate_toolpath(path, model, chord_mm=1.0)
    # One move for the line: it leaves the curve by the whole wave, about 10 µm times the height over the strut's way.
    row = np.flatnonzero(done.toolpath.kind == RowKind.FEED)
    share = np.linspace(0.0, 1.0, 1001)
    reached = model.actual_poses(
        Motion(poses=done.toolpath.between(np.repeat(row, 1001), np.tile(share, len(row))), is_path=True)
    )
    off_um = 1e3 * felt_mm(reached - path.between(np.repeat(row, 1001), share)).max()
    assert off_um > 5.0
    assert done.chord_um == pytest.approx(off_um, rel=0.05)


class Waved(LinearSource):
    """All struts are longer by a wave along X."""

    name = "waved"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.POSE})
    texts = Texts("", "", "", "", "", "")

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("amount_mm", "mm", 0.01, ""),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        wave = np.sin(np.pi * motion.poses[:, 0] / 50.0)
        return Effect(strut_mm=np.repeat(wave[:, None, None], 6, axis=1))


def test_the_chord_error_is_that_of_all_places_of_a_piece(linuxcnc, reference):
    """A piece whose ends and whose middle lie on it: a whole wave, against 800 places of the inverse itself."""
    model = MachineModel(reference, (Fitted(Waved(), np.array([0.02])),))
    path = linuxcnc.read("G21 G90\nG0 X-50 Y0 Z-1000 A0 B0 C0\nG1 X50 F1000\nM2\n", "line.ngc")
    done = compensate_toolpath(path, model, chord_mm=1.0)
    share = np.linspace(0.0, 1.0, 801)
    at = compensated(model, Motion(poses=path.between(np.ones(801, dtype=np.int64), share), is_path=True))
    off_um = 1e3 * felt_mm(at - (at[0] + share[:, None] * (at[-1] - at[0])))
    assert off_um[400] < 0.05
    assert off_um.max() > 20.0
    assert done.chord_um == pytest.approx(off_um.max(), rel=0.02)


def test_a_tolerance_that_is_missed_is_said_and_strictly_refused_with_what_is_kept(linuxcnc, reference):
    machine = replace(reference, acceleration_mm_s2=50_000.0)
    model = MachineModel(machine, (Fitted(Wound(), np.array([0.03])),))
    path = linuxcnc.read("G21 G90\nG0 X-100 Y10 Z-1000 A0 B0 C0\nG1 X100 F100\nM2\n", "line.ngc")
    done = compensated_program(path, linuxcnc, Inverse(model))
    assert 1.0 < done.chord_error_um <= 100.0
    assert f"; chord error asked for 0.1 um, reached {done.chord_error_um:.3f} um" in done.text
    (told,) = done.remarks
    assert re.match(r"the path is kept within \d+ µm, not within 0\.1 µm, at [^ ]*:3: the correction has a step", told)
    with pytest.raises(StationError, match=r"line\.ngc:3: the path is kept within \d+ µm here") as refused:
        compensated_program(path, linuxcnc, Inverse(model, strict=True))
    kept_um = float(re.search(r"--chord-um (\S+) is kept", str(refused.value))[1])
    compensated_program(path, linuxcnc, Inverse(model, strict=True), chord_mm=kept_um / 1e3)


def test_position_only_leaves_the_tilt_and_keeps_the_tip(linuxcnc, crooked):
    path = linuxcnc.read("G21 G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F1000\nM2\n", "line.ngc")
    done = compensate_toolpath(path, crooked, planner=SLOW, prefer=Prefer.POSITION_ONLY)
    assert np.all(done.toolpath.poses[:, 3:] == 0.0)
    reached = crooked.actual_poses(Motion(poses=done.toolpath.poses, is_path=True))
    assert np.abs(reached[:, 1:3] - [0.0, -1000.0]).max() < 2e-6
    left_um = 1e3 * 100.0 * np.radians(np.linalg.norm(reached[:, 3:], axis=1)).max()
    assert done.tilt_um == pytest.approx(left_um, rel=0.02)


def test_a_circle_takes_the_step_that_its_feed_needs(linuxcnc, table2, crooked):
    """150 mm at 1000 mm/min and 1 m/s²: 2v²/a = 0.556 mm, 0.212 degrees, and somewhat more for servo cycles."""
    machine = replace(crooked.machine, acceleration_mm_s2=1000.0)
    model = MachineModel(machine, crooked.sources)
    (one, _) = circle_programs(table2, machine, linuxcnc, inverse=Inverse(model), tests=["a"])
    path = linuxcnc.read(one.text, one.file)
    arc_mm = np.median(path.tip_mm[path.kind == RowKind.FEED])
    assert 2.0 * (1000.0 / 60.0) ** 2 / 1000.0 < arc_mm < 0.65
    assert one.chord_error_um == pytest.approx(1e3 * arc_mm**2 / (8.0 * 150.0), rel=0.05)
    assert one.feed_s <= 1.01 * one.nominal_feed_s


def test_a_circle_that_is_slower_is_written_and_says_so(linuxcnc, table2, crooked):
    """At 0.1 µm: pieces of 0.34 mm in place of 0.56 mm; strictly refused with the feed that all of them keep."""
    machine = replace(crooked.machine, acceleration_mm_s2=1000.0)
    model = MachineModel(machine, crooked.sources)
    (slow, _) = circle_programs(table2, machine, linuxcnc, inverse=Inverse(model), tests=["a"], chord_mm=1e-4)
    assert slow.chord_error_um <= 0.1
    (told,) = slow.remarks
    said = f"about {slow.feed_s:.0f} s at feed, {slow.nominal_feed_s:.0f} as written, with the acceleration of 1 m/s²"
    assert told == f"{said} (of the machine file)"
    with pytest.raises(StationError, match=r"test a ccw: the control reaches F7\d\d here") as refused:
        circle_programs(table2, machine, linuxcnc, inverse=Inverse(model, strict=True), tests=["a"], chord_mm=1e-4)
    reached = float(re.search(r"; F(\d+) is kept everywhere", str(refused.value))[1])
    assert slow.feed_s == pytest.approx(slow.nominal_feed_s * 1000.0 / reached, rel=0.01)
    circle = replace(table2.tests["a"].circle, feed_mm_min=reached)
    plan = replace(table2, tests={"a": replace(table2.tests["a"], circle=circle)})
    circle_programs(plan, machine, linuxcnc, inverse=Inverse(model, strict=True), tests=["a"], chord_mm=1e-4)


class Unknown(LinuxCNC):
    """A control of which nobody said how far it looks ahead."""

    look_ahead = None


def test_a_look_ahead_that_is_not_known_is_said(crooked):
    path = LinuxCNC().read("G21 G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F1000\nM2\n", "line.ngc")
    done = compensated_program(path, Unknown(), Inverse(crooked, strict=True))
    assert done.remarks == ("how far linuxcnc looks ahead is not known: whether it keeps F was not checked",)
    assert done.feed_s is None


def test_needed_length_and_reached_speed_are_inverses(linuxcnc, reference):
    planner = planner_of(reference, linuxcnc)
    mm_s = np.array([1.0, 16.7, 100.0])
    np.testing.assert_allclose(planner.reached_mm_s(planner.needed_mm(mm_s)), mm_s, rtol=1e-12)
    assert planner.acceleration_mm_s2 == 1000.0
