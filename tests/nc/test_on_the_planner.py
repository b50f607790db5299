"""Compensated programs on LinuxCNC's trajectory planner: they take the time of the nominal ones, and stay near the path.

Needs LinuxCNC (package `linuxcnc-uspace`). Its clock runs ten times as fast as usual: with every speed ten times as large
and every acceleration a hundred times it plans the same way in each servo cycle (`tests/nc/planner/linuxcnc.py`).
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import StationError
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse, circle_programs, compensated_program, planner_of
from dbbstation.nc.planner import KEPT
from dbbstation.plan.plan import Plan
from tests.nc.planner.linuxcnc import Ran, missing, run
from tests.nc.planner.required import needs

REASON = missing()
pytestmark = [
    needs(REASON),
    # There is one LinuxCNC on a computer at a time.
    pytest.mark.xdist_group("linuxcnc"),
]

FASTER = 10

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


def off_the_path_mm(ran: Ran, corners: np.ndarray) -> float:
    """Greatest distance of every fifth servo cycle from the straight moves of a program, in position [mm]."""
    worst, nearest = 0.0, 0
    begin, way = corners[:-1, :3], np.diff(corners[:, :3], axis=0)
    length2 = np.maximum(np.einsum("ni,ni->n", way, way), 1e-30)
    for pose in ran.poses[::5, :3]:
        # The planner goes forwards: the nearest move is the last one or one of the next.
        near = slice(max(nearest - 2, 0), nearest + 16)
        share = np.clip(np.einsum("ni,ni->n", pose - begin[near], way[near]) / length2[near], 0.0, 1.0)
        distance = np.linalg.norm(pose - begin[near] - share[:, None] * way[near], axis=1)
        nearest = near.start + int(np.argmin(distance))
        worst = max(worst, float(distance.min()))
    return worst


def ran_both(linuxcnc, nominal: str, compensated: str, mm_s2: float, faster: int = FASTER) -> tuple[Ran, Ran]:
    both = [run(text, mm_s2=mm_s2, faster=faster) for text in (nominal, compensated)]
    # What LinuxCNC makes of the nominal one is not ours: beside its own arcs it leaves P at high feeds.
    path = linuxcnc.read(compensated, "written.ngc")
    corners = path.poses[path.is_move]
    assert off_the_path_mm(both[1], corners) < np.nanmax(path.corners_mm[path.is_move]) + 2e-6
    np.testing.assert_allclose(both[1].poses[-1], corners[-1], atol=2e-6)
    return both[0], both[1]


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


def circle_texts(linuxcnc, table2, crooked, bar_mm: float, feed: float, mm_s2: float | None, prefer=None) -> list[str]:
    """Nominal and compensated program of test a, with another bar and feed."""
    test = table2.tests["a"]
    circle = replace(test.circle, bar_mm=bar_mm, feed_mm_min=feed)
    plan = Plan("one circle", {"a": replace(test, circle=circle)})
    machine = replace(crooked.machine, acceleration_mm_s2=mm_s2)
    inverse = Inverse(MachineModel(machine, crooked.sources), prefer=prefer)
    both = [
        circle_programs(plan, machine, linuxcnc, inverse=each, approach=None, chord_mm=1e-3, tests=["a"])
        for each in (None, inverse)
    ]
    return [programs[0].text for programs in both]


@pytest.mark.parametrize("prefer", [None, pytest.param(Prefer.POSITION_ONLY, marks=pytest.mark.nightly)])
def test_a_small_circle_keeps_its_feed(linuxcnc, table2, crooked, prefer):
    """At 1 m/s², which is taken where the machine file does not say it; it took 1.37 times as long in steps of 0.1 degrees."""
    texts = circle_texts(linuxcnc, table2, crooked, 50.0, 1000.0, None, prefer)
    first, second = ran_both(linuxcnc, *texts, 1000.0)
    assert second.moving_s / first.moving_s <= KEPT


def test_a_part_that_is_refused_reaches_the_feed_that_is_said(linuxcnc, crooked):
    """Written at the feed of the message it keeps that; at its own, with the chord preferred, it takes the time that is said."""
    model = accelerating(crooked, 1000.0)
    with pytest.raises(StationError, match=r"arc\.ngc:\d+: F1500 cannot be kept within 0\.1 µm") as caught:
        compensated_program(linuxcnc.read(ARC.format(feed=1500), "arc.ngc"), linuxcnc, Inverse(model))
    feed = int(re.search(r"reaches F(\d+)", str(caught.value))[1])
    assert 500 < feed < 800
    nominal = ARC.format(feed=feed)
    done = compensated_program(linuxcnc.read(nominal, "arc.ngc"), linuxcnc, Inverse(model))
    first, second = ran_both(linuxcnc, nominal, done.text, 1000.0)
    assert second.moving_s / first.moving_s <= KEPT
    slow = compensated_program(
        linuxcnc.read(ARC.format(feed=1500), "arc.ngc"), linuxcnc, Inverse(model, prefer=Prefer.ACCURACY)
    )
    ran = run(slow.text, mm_s2=1000.0, faster=FASTER)
    assert ran.moving_s == pytest.approx(slow.feed_s, rel=0.03)
    assert slow.feed_s > 1.2 * slow.nominal_feed_s


@pytest.mark.nightly
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("mm_s2", [500.0, 1000.0, 5000.0])
@pytest.mark.parametrize("feed", [1000, 3000, 6000])
@pytest.mark.parametrize("what", ["circle", "part", "arc"])
def test_every_program_that_is_written_keeps_its_feed(linuxcnc, table2, crooked, what, feed, mm_s2, capsys):
    model = accelerating(crooked, mm_s2)
    for prefer in (None, Prefer.FEED, Prefer.POSITION_ONLY):
        told = f"| {what} | {feed} | {mm_s2 / 1e3:g} | {prefer.value if prefer else ''} |"
        try:
            if what == "circle":
                texts = circle_texts(linuxcnc, table2, crooked, 150.0, float(feed), mm_s2, prefer)
            else:
                nominal = {"part": PART, "arc": ARC}[what].format(feed=feed)
                done = compensated_program(
                    linuxcnc.read(nominal, f"{what}.ngc"), linuxcnc, Inverse(model, prefer=prefer), chord_mm=1e-3
                )
                texts = [nominal, done.text]
        except StationError as refused:
            with capsys.disabled():
                print(f"{told} refused: {refused} |")  # noqa: T201 - the table of the docs
            continue
        # Its interpreter runs at the usual clock, and must keep ahead of the planner.
        first, second = ran_both(linuxcnc, *texts, mm_s2, faster=max(12_000 // feed, 2))
        ratio = second.moving_s / first.moving_s
        with capsys.disabled():
            print(f"{told} {first.moving_s:.2f} | {second.moving_s:.2f} | {ratio:.4f} |")  # noqa: T201
        assert ratio <= KEPT


def test_curves_in_short_lines_are_joined(linuxcnc, crooked):
    """Lines of 0.2 mm at F1000 are too short for 1 m/s²: pieces join their ends, within the chord error."""
    angle = np.radians(np.arange(0.0, 90.0, 0.115))
    lines = [f"G1 X{100 * np.cos(a):.6f} Y{100 * np.sin(a):.6f}" for a in angle]
    text = "\n".join(["G21 G90 G94 G64 P0.001", "G0 X100 Y0 Z-1000 A0 B0 C0", "F1000", *lines, "M2", ""])
    done = compensated_program(
        linuxcnc.read(text, "short.ngc"), linuxcnc, Inverse(accelerating(crooked, 1000.0)), chord_mm=1e-3
    )
    assert done.points < 0.5 * len(lines)
    assert done.chord_um <= 1.0
    first, second = ran_both(linuxcnc, text, done.text, 1000.0)
    assert second.moving_s / first.moving_s <= KEPT
