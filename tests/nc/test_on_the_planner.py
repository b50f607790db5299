"""Compensated programs on LinuxCNC's trajectory planner: they take the time of the nominal ones, and stay near the path.

Needs LinuxCNC (package `linuxcnc-uspace`). Its clock runs ten times as fast as usual: with every speed ten times as large
and every acceleration a hundred times it plans the same way in each servo cycle (`dbbstation.virtual.linuxcnc.py`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import KEPT, Inverse, compensated_program, planner_of
from dbbstation.nc.planner import cuts
from dbbstation.plan.plan import Plan
from dbbstation.virtual.linuxcnc import PERIOD_NS, BehindError, PlannerRun, missing, run, run_once
from tests.nc.planner.required import needs

if TYPE_CHECKING:
    from dbbstation.nc.export import Program
    from dbbstation.nc.toolpath import Toolpath

REASON = missing()
pytestmark = [
    needs(REASON),
    # There is one LinuxCNC on a computer at a time.
    pytest.mark.xdist_group("linuxcnc"),
]

FASTER = 10

MOVES_ASIDE = 8
"""The line that LinuxCNC names in a cycle is that of a move so near to the one that it is on."""

PRINTED_MM = 2e-6
"""Poses and programs have six decimals."""

PART = """\
G21 G90 G94
G64 P0.01
G0 X-60 Y-40 Z-1000 A5 B-4 C0
G1 X60 F{feed}
G1 Y40
G3 X40 Y60 I-20
G1 X-60 A-5 B4
G1 Y-40 Z-1010
M2
"""

ARC = """\
G21 G90 G94
G64 P0.01
G0 X60 Y0 Z-1000 A0 B0 C0
G3 X-60 Y0 I-60 F{feed}
G2 X60 Y0 I60 A3 B-2
M2
"""


def accelerating(model: MachineModel, mm_s2: float) -> MachineModel:
    return MachineModel(replace(model.machine, acceleration_mm_s2=mm_s2), model.sources)


def off_the_path_mm(ran: PlannerRun, path: Toolpath) -> float:
    """Greatest distance of a servo cycle from the straight moves of a program, in position [mm].

    Args:
        path: the program as it is read, without arcs, so that each move has a line of its own.
    """
    corners, lines = path.poses[path.is_move, :3], path.line[path.is_move]
    begin, way = corners[:-1], np.diff(corners, axis=0)
    length2 = np.maximum(np.einsum("ni,ni->n", way, way), 1e-30)
    # Where it stands still LinuxCNC names no line.
    named = np.maximum.accumulate(np.where(ran.line > 0, np.arange(len(ran.line)), 0))
    there = np.searchsorted(lines[1:], ran.line[named])
    nearest = np.full(len(there), np.inf)
    for step in range(-MOVES_ASIDE, MOVES_ASIDE + 1):
        move = np.clip(there + step, 0, len(way) - 1)
        off = ran.poses[:, :3] - begin[move]
        share = np.clip(np.einsum("ni,ni->n", off, way[move]) / length2[move], 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(off - share[:, None] * way[move], axis=1))
    return float(nearest.max())


def allowed_mm(path: Toolpath, mm_s2: float) -> float:
    """How far LinuxCNC may go from the straight moves of a program [mm]: P, and what it adds to that by itself.

    It joins servo cycles by a cubic whose places are (x₀ + 4 x₁ + x₂) / 6 [`src/emc/motion/cubic.c`]: a·t²/6. Where A, B
    and C stand still it puts arcs into corners, with a move that is running already as well. Such a move begins anew, and the
    rest of the path is shifted by what had been run of it [`tpHandleBlendArc`, `tpAddCurrentPos` in `src/emc/tp/tp.c`]: by the
    first cycle from standstill, a·t²/2, where the interpreter is one move behind there.
    """
    cycle_mm = mm_s2 * (PERIOD_NS / 1e9) ** 2
    has_arcs = np.any(cuts(path) & (path.turn_deg == 0.0))
    return float(np.nanmax(path.corners_mm[path.is_move])) + cycle_mm / 6.0 + has_arcs * cycle_mm / 2.0 + PRINTED_MM


def judged(
    text: str, path: Toolpath, mm_s2: float, faster: int, more_mm: float = 0.0, at_most_s: float = math.inf
) -> tuple[PlannerRun, float]:
    """Run a program; also how far it was from its moves at most [mm].

    `more_mm` may be added to what is allowed.

    On a busy computer the interpreter can fall behind for an instant that nobody sees. What is off the path with a faster clock, or
    takes longer than `at_most_s`, is run with a slower one: the usual clock decides.
    """
    while True:
        ran = run(text, mm_s2=mm_s2, faster=faster)
        off_mm = off_the_path_mm(ran, path)
        is_good = off_mm < allowed_mm(path, mm_s2) + more_mm and ran.moving_s <= at_most_s
        if is_good or faster == 1:
            return ran, off_mm
        faster = max(faster // 2, 1)


def on_its_path(linuxcnc, text: str, mm_s2: float, faster: int = FASTER) -> PlannerRun:
    """Run a program that was written here; it must stay near its moves and end where it should."""
    path = linuxcnc.read(text, "written.ngc")
    ran, off_mm = judged(text, path, mm_s2, faster)
    assert off_mm < allowed_mm(path, mm_s2)
    np.testing.assert_allclose(ran.poses[-1], path.poses[path.is_move][-1], atol=2e-6)
    return ran


def test_the_planner_can_run_here():
    assert not REASON


def test_a_piece_that_turns_reaches_what_the_look_ahead_says(linuxcnc, reference):
    """v² = a·L/2, less what is lost to servo cycles: measured here on a straight line in equal pieces."""
    planner = planner_of(replace(reference, acceleration_mm_s2=1000.0), linuxcnc)
    for length_mm in (0.2, 0.5556, 2.0):
        count = math.ceil(30.0 / length_mm)
        lines = [f"G1 X{k * length_mm:.6f} A{1e-4 * math.sin(0.3 * k):.7f}" for k in range(1, count)]
        ran = run("\n".join(["G21 G90 G64", "G1 X0 Y0 Z-1000 A0 B0 C0 F6000", *lines, "M2"]), faster=FASTER)
        middle = (ran.poses[:, 0] > 8.0) & (ran.poses[:, 0] < 22.0)
        mm_s = np.ptp(ran.poses[middle, 0]) / np.ptp(ran.time_s[middle])
        assert mm_s <= 1.001 * math.sqrt(1000.0 * length_mm / 2.0)
        reached = float(planner.reached_mm_s(np.array(length_mm)))
        assert 0.99 * reached < mm_s
        assert 0.93 * mm_s < reached


def circle_programs_of(
    linuxcnc, table2, crooked, bar_mm: float, feed: float, mm_s2: float | None, prefer=None
) -> tuple[str, Program]:
    test = table2.tests["a"]
    circle = replace(test.circle, bar_mm=bar_mm, feed_mm_min=feed)
    plan = Plan("one circle", {"a": replace(test, circle=circle)})
    machine = replace(crooked.machine, acceleration_mm_s2=mm_s2)
    inverse = Inverse(MachineModel(machine, crooked.sources), prefer=prefer)
    nominal, compensated = (
        circle_programs(plan, machine, linuxcnc, inverse=each, clearance_mm=None, chord_mm=1e-3, tests=["a"])[0]
        for each in (None, inverse)
    )
    return nominal.text, compensated


@pytest.mark.parametrize("prefer", [Prefer.ACCURACY, pytest.param(Prefer.POSITION_ONLY, marks=pytest.mark.nightly)])
def test_a_small_circle_keeps_its_feed(linuxcnc, table2, crooked, prefer):
    """At 1 m/s², which is taken where the machine file does not say it; it took 1.37 times as long in steps of 0.1 degrees."""
    nominal, compensated = circle_programs_of(linuxcnc, table2, crooked, 50.0, 1000.0, None, prefer)
    first, second = (on_its_path(linuxcnc, text, 1000.0) for text in (nominal, compensated.text))
    assert second.moving_s / first.moving_s <= KEPT


@pytest.mark.parametrize(
    ("what", "feed"), [("arc", 1500), ("part", 1000), pytest.param("part", 3000, marks=pytest.mark.nightly)]
)
def test_the_time_that_is_said_is_taken(linuxcnc, crooked, what, feed):
    """Within a tenth: short pieces run up to 8 % fast, and ramps at corners are not reckoned."""
    model = accelerating(crooked, 1000.0)
    path = linuxcnc.read({"part": PART, "arc": ARC}[what].format(feed=feed), f"{what}.ngc")
    done = compensated_program(path, linuxcnc, Inverse(model))
    ran = on_its_path(linuxcnc, done.text, 1000.0)
    assert ran.moving_s == pytest.approx(done.feed_s, rel=0.1)
    assert (done.feed_s > 1.2 * done.nominal_feed_s) == (what == "arc" or feed > 1000)


@pytest.mark.nightly
@pytest.mark.parametrize(("feed", "mm_s2"), [(1000, 1000.0), (3000, 500.0), (6000, 1000.0), (6000, 5000.0)])
def test_nominal_circles_stay_on_their_path(linuxcnc, table2, crooked, feed, mm_s2):
    """At the usual clock; 0.25 µm in X and Y beside it where arcs are put into corners, at 1 m/s² and F6000."""
    nominal, _ = circle_programs_of(linuxcnc, table2, crooked, 150.0, float(feed), mm_s2, Prefer.ACCURACY)
    on_its_path(linuxcnc, nominal, mm_s2, faster=1)


@pytest.mark.parametrize("counts_to", [0, 10_000_000])
def test_an_interpreter_that_falls_behind_is_noticed(counts_to):
    """29 µm beside the path and 1.07 times as long, where this was not looked for. Here it counts, 1000 moves ahead of the planner."""
    lines = [f"G1 X{0.2 * k:.1f} A{1e-4 * math.sin(0.3 * k):.7f}" for k in range(1, 1600)]
    counting = ["#1 = 0", f"o1 while [#1 LT {counts_to}]", "#1 = [#1 + 1]", "o1 endwhile"]
    text = ["G21 G90 G64", "G1 X0 Y0 Z-1000 A0 B0 C0 F1000", *lines[:1500], *counting, *lines[1500:], "M2"]
    if counts_to:
        with pytest.raises(BehindError):
            run_once("\n".join(text), 1000.0, FASTER)
    else:
        run_once("\n".join(text), 1000.0, FASTER)


def test_curves_in_short_lines_are_joined(linuxcnc, crooked):
    """Lines of 0.2 mm at F1000 are too short for 1 m/s²: pieces join their ends, within the chord error."""
    angle = np.radians(np.arange(0.0, 90.0, 0.115))
    lines = [f"G1 X{100 * np.cos(a):.6f} Y{100 * np.sin(a):.6f}" for a in angle]
    text = "\n".join(["G21 G90 G94 G64 P0.001", "G0 X100 Y0 Z-1000 A0 B0 C0", "F1000", *lines, "M2", ""])
    done = compensated_program(
        linuxcnc.read(text, "short.ngc"), linuxcnc, Inverse(accelerating(crooked, 1000.0)), chord_mm=1e-3
    )
    assert done.points < 0.5 * len(lines)
    assert done.chord_error_um <= 1.0
    first, second = run(text, mm_s2=1000.0, faster=FASTER), on_its_path(linuxcnc, done.text, 1000.0)
    assert second.moving_s / first.moving_s <= KEPT
