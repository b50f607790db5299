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
from dbbstation.nc.compensate import Prefer, compensate_toolpath
from dbbstation.nc.curve import felt_mm
from dbbstation.nc.export import Inverse, Program, circle_programs, compensated_program, planner_of
from dbbstation.nc.pieces import longest, truest
from dbbstation.nc.planner import KEPT, LookAhead, Planner
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Effect, Fitted, LinearSource, Motion, Need, Owner, Parameter, Texts
from tests.nc.test_compensate_any import Wound

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
def test_the_shortest_piece_is_as_long_as_any_cut_allows(seed):
    way, curve = drawn(seed)
    tolerance = 0.15
    ended = (0, *longest(way, curve, np.ones(len(way), dtype=bool), tolerance).tolist())
    assert all(distance(way, curve, a, b) <= tolerance for a, b in pairwise(ended))
    lengths = []
    for cut in every_cut(len(way)):
        pairs = list(pairwise(cut))
        # Neighbours may always be joined: there is nothing between them.
        if all(distance(way, curve, a, b) <= tolerance for a, b in pairs):
            lengths.append(min(way[b] - way[a] for a, b in pairs))
    assert min(way[b] - way[a] for a, b in pairwise(ended)) == pytest.approx(max(lengths))


@pytest.mark.parametrize("seed", range(12))
def test_pieces_of_a_least_length_are_as_near_as_any_cut_allows(seed):
    way, curve = drawn(seed)
    least = 1.5
    ended = (0, *truest(way, curve, np.ones(len(way), dtype=bool), least).tolist())
    worst = {}
    for cut in every_cut(len(way)):
        pairs = list(pairwise(cut))
        if all(way[b] - way[a] >= least for a, b in pairs):
            worst[cut] = max(distance(way, curve, a, b) for a, b in pairs)
    # Some of the places in each least length are left out of the choice; here there are few enough to keep nearly all.
    assert worst[ended] <= 1.3 * min(worst.values())


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
    done = compensate_toolpath(path, model, chord_mm=None)
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
    done = compensate_toolpath(path, model, chord_mm=None)
    share = np.linspace(0.0, 1.0, 801)
    at = compensated(model, Motion(poses=path.between(np.ones(801, dtype=np.int64), share), is_path=True))
    off_um = 1e3 * felt_mm(at - (at[0] + share[:, None] * (at[-1] - at[0])))
    assert off_um[400] < 0.05
    assert off_um.max() > 20.0
    assert done.chord_um == pytest.approx(off_um.max(), rel=0.02)


def test_a_tolerance_that_is_missed_is_refused_unless_a_number_accepts_it(linuxcnc, reference):
    machine = replace(reference, acceleration_mm_s2=50_000.0)
    model = MachineModel(machine, (Fitted(Wound(), np.array([0.03])),))
    path = linuxcnc.read("G21 G90\nG0 X-100 Y10 Z-1000 A0 B0 C0\nG1 X100 F100\nM2\n", "line.ngc")
    with pytest.raises(StationError, match=r"line\.ngc:3: the path is kept within \d+ µm here, not within 0\.1 µm"):
        compensated_program(path, linuxcnc, Inverse(model))
    with pytest.raises(StationError, match="--accept-chord-um"):
        compensated_program(path, linuxcnc, Inverse(model, accepted_um=1.0))
    done = compensated_program(path, linuxcnc, Inverse(model, accepted_um=100.0))
    assert 1.0 < done.chord_um <= 100.0
    assert f"; chord error asked for 0.1 um, reached {done.chord_um:.3f} um" in done.text


def test_position_only_leaves_the_tilt_and_keeps_the_tip(linuxcnc, crooked):
    path = linuxcnc.read("G21 G90\nG0 X-100 Y0 Z-1000 A0 B0 C0\nG1 X100 F1000\nM2\n", "line.ngc")
    done = compensate_toolpath(path, crooked, planner=SLOW, prefer=Prefer.POSITION_ONLY)
    assert np.all(done.toolpath.poses[:, 3:] == 0.0)
    reached = crooked.actual_poses(Motion(poses=done.toolpath.poses, is_path=True))
    assert np.abs(reached[:, 1:3] - [0.0, -1000.0]).max() < 2e-6
    left_um = 1e3 * 100.0 * np.radians(np.linalg.norm(reached[:, 3:], axis=1)).max()
    assert done.tilt_um == pytest.approx(left_um, rel=0.02)
    assert done.slow is None


def test_a_circle_takes_the_step_that_its_feed_needs(linuxcnc, table2, crooked):
    """150 mm at 1000 mm/min and 1 m/s²: 2v²/a = 0.556 mm, 0.212 degrees, and somewhat more for servo cycles."""
    machine = replace(crooked.machine, acceleration_mm_s2=1000.0)
    model = MachineModel(machine, crooked.sources)
    (one, _) = circle_programs(table2, machine, linuxcnc, inverse=Inverse(model), tests=["a"])
    path = linuxcnc.read(one.text, one.name)
    arc_mm = np.median(path.tip_mm[path.kind == RowKind.FEED])
    assert 2.0 * (1000.0 / 60.0) ** 2 / 1000.0 < arc_mm < 0.65
    assert one.chord_um == pytest.approx(1e3 * arc_mm**2 / (8.0 * 150.0), rel=0.05)
    assert one.feed_s <= 1.01 * one.nominal_feed_s


def test_a_circle_that_is_slower_is_as_fast_as_its_chord_allows(linuxcnc, table2, crooked):
    """At 0.1 µm: pieces of 0.34 mm in place of 0.26 mm, and the feed that the refusal names."""
    machine = replace(crooked.machine, acceleration_mm_s2=1000.0)
    model = MachineModel(machine, crooked.sources)
    with pytest.raises(
        StationError, match=r"test a ccw: F1000 cannot be kept within 0\.1 µm: the control reaches F7\d\d"
    ) as refused:
        circle_programs(table2, machine, linuxcnc, inverse=Inverse(model), tests=["a"], chord_mm=1e-4)
    fine = Inverse(model, prefer=Prefer.ACCURACY)
    (slow, _) = circle_programs(table2, machine, linuxcnc, inverse=fine, tests=["a"], chord_mm=1e-4)
    assert slow.chord_um <= 0.1
    reached = float(re.search(r"reaches F(\d+)", str(refused.value))[1])
    assert slow.feed_s == pytest.approx(slow.nominal_feed_s * 1000.0 / reached, rel=0.01)
    assert "--prefer accuracy costs" in slow.text


SQUARES = """\
G21 G90 G94 G64 P0.01
G0 X0 Y0 Z-1000 A0 B0 C0
F{feed}
G1 X20
G1 Y20
G1 X0
G1 Y0
M2
"""


def test_the_feed_that_a_refusal_of_ramps_names_is_kept(linuxcnc, crooked):
    """Three sides end in a corner with half the acceleration: v/a more, less an overlap of 2√(2P/(a·sin 45°)) = 10.6 ms.

    Of the 80/v seconds of all sides 0.765 % may be lost (`NAMED`): F1240, or F940 where the nominal program is quicker in its corners
    by as much as arcs of R = P·cos 45°/(1 - cos 45°) let it be, 8 ms.
    """
    model = MachineModel(replace(crooked.machine, acceleration_mm_s2=1000.0), crooked.sources)

    def written(feed_mm_min: float) -> Program:
        path = linuxcnc.read(SQUARES.format(feed=feed_mm_min), "squares.ngc")
        return compensated_program(path, linuxcnc, Inverse(model, prefer=Prefer.FEED))

    with pytest.raises(StationError, match="F1500 cannot be kept with --prefer feed either") as refused:
        written(1500.0)
    feed_mm_min = float(re.search(r"give F(\d+) or less", str(refused.value))[1])
    assert 936.0 < feed_mm_min < 1240.0
    done = written(feed_mm_min)
    assert done.feed_s <= KEPT * done.nominal_feed_s


def test_needed_length_and_reached_speed_are_inverses(linuxcnc, reference):
    planner = planner_of(reference, linuxcnc)
    mm_s = np.array([1.0, 16.7, 100.0])
    np.testing.assert_allclose(planner.reached_mm_s(planner.needed_mm(mm_s)), mm_s, rtol=1e-12)
    assert planner.acceleration_mm_s2 == 1000.0
