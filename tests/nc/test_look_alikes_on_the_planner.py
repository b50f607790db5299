"""What LinuxCNC's planner makes of programs as other people write them, nominal and compensated: time and path.

`DBBSTATION_LOOK_ALIKES=200` runs as many in the nightly test, which prints a row for each; `DBBSTATION_LOOK_ALIKES_FROM` is the first seed.
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.errors import StationError
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.merging import queued
from dbbstation.nc.planner import KEPT, Planner
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind, Toolpath
from tests.nc.look_alikes import STYLES, look_alike
from tests.nc.planner.linuxcnc import PERIOD_NS, Ran, missing, run
from tests.nc.planner.required import needs
from tests.nc.test_on_the_planner import accelerating, allowed_mm, judged, off_the_path_mm

if TYPE_CHECKING:
    from collections.abc import Callable

REASON = missing()
pytestmark = [
    needs(REASON),
    # There is one LinuxCNC on a computer at a time.
    pytest.mark.xdist_group("linuxcnc"),
]

FASTER = 5
ACCELERATIONS_MM_S2 = (500.0, 1000.0, 2000.0, 5000.0)
FIRST = int(os.environ.get("DBBSTATION_LOOK_ALIKES_FROM", "0"))
COUNT = int(os.environ.get("DBBSTATION_LOOK_ALIKES", "64"))


def feed_s(ran: Ran, path: Toolpath) -> float:
    """Time in motion in lines at feed [s]."""
    moves = np.any(np.diff(ran.poses, axis=0) != 0.0, axis=1)
    at_feed = np.isin(ran.line[1:], path.line[path.kind == RowKind.FEED])
    return float(np.diff(ran.time_s)[moves & at_feed].sum())


def within_a_cycle_mm(path: Toolpath, mm_s2: float) -> float:
    """How far corners between moves that turn may be left beside P [mm]: they overlap from one cycle on, half of one too early at most.

    A corner of 90 degrees is run at v = 2·√(a/2·P/sin 45°) where the overlap begins, at half of it in its middle. P 0.1 mm at 0.5 m/s²: 3 µm;
    1.8 µm were measured.
    """
    bound_mm = float(path.corners_mm[path.is_move].max())
    mm_s = 2.0 * np.sqrt(mm_s2 / 2.0 * bound_mm / np.sqrt(0.5))
    return float(mm_s / 2.0 * PERIOD_NS / 1e9 / 2.0)


def beyond_bound(turned_rad: float, more: float) -> float:
    """How far a corner between two moves that turn is left, as a share of P.

    The first one has the deceleration a, and the second one begins where the first one is 2·P / sin(φ/2) from the corner, which is
    right where both have the same acceleration. With an acceleration r·a of the second one they are as far from the corner at
    the same time where the path is left by 4·r·cos(φ/2) / (1 + √r)² of P.
    """
    return 4.0 * more * math.cos(turned_rad / 2.0) / (1.0 + math.sqrt(more)) ** 2


def beyond_p_mm(path: Toolpath) -> float:
    """By how much LinuxCNC leaves corners between moves that turn beyond P, at most [mm].

    Before a rapid or an exact stop the last of them has all of the acceleration, the one before it half. Axes have limits each, so that
    a move across two of them accelerates faster than one along one.
    """
    moves = np.flatnonzero(path.is_move)
    way = (path.poses - path.before)[moves, :3]
    length = np.linalg.norm(way, axis=1)
    most, bound_mm = 0.0, path.corners_mm[moves]
    for k in np.flatnonzero((length[1:] > 0.0) & (length[:-1] > 0.0) & (path.turn_deg[moves[1:]] > 0.0)):
        first, second = (way[i] / length[i] for i in (k, k + 1))
        ends = k + 2 == len(moves) or path.kind[moves[k + 2]] != path.kind[moves[k + 1]] or bound_mm[k + 1] == 0.0
        more = float(np.abs(first).max() / np.abs(second).max()) * (2.0 if ends else 1.0)
        turned_rad = math.acos(float(np.clip(first @ second, -1.0, 1.0)))
        most = max(most, float(bound_mm[k]) * (beyond_bound(turned_rad, more) - 1.0))
    return most


def check(seed: int, linuxcnc, model) -> str:
    """Compensate one in the first way that keeps its feed, run both, and return a row of the table."""
    text, mm_s2 = look_alike(seed), ACCELERATIONS_MM_S2[seed // len(STYLES) % len(ACCELERATIONS_MM_S2)]
    path, inverses = read_program(text, "drawn.ngc"), accelerating(model, mm_s2)
    for prefer in (None, Prefer.POSITION_ONLY, Prefer.FEED):
        try:
            done = compensated_program(path, linuxcnc, Inverse(inverses, prefer=prefer), chord_mm=1e-3)
        except StationError as refused:
            said = str(refused)
            continue
        break
    else:
        assert "drawn.ngc:" in said
        return f"| {seed} | refused | | | | | |"
    nominal = run(text, mm_s2=mm_s2, faster=FASTER)
    read = read_program(done.text, "written.ngc")
    bounded = np.isfinite(read.corners_mm[read.is_move]).all()
    more_mm = within_a_cycle_mm(read, mm_s2) + beyond_p_mm(read) if bounded else 0.0
    ran, off_mm = (
        judged(done.text, read, mm_s2, FASTER, more_mm)
        if bounded
        else (run(done.text, mm_s2=mm_s2, faster=FASTER), 0.0)
    )
    first, second = feed_s(nominal, path), feed_s(ran, read)
    ratio, total = second / first, ran.moving_s / nominal.moving_s
    assert ratio <= KEPT, f"seed {seed}: {first} s at feed, compensated {second} s\n{text}"
    assert total <= KEPT or done.slower_rapids, (
        f"seed {seed}: {nominal.moving_s} s in all, compensated {ran.moving_s} s\n{text}"
    )
    if bounded:
        assert off_mm < allowed_mm(read, mm_s2) + more_mm, f"seed {seed}: {off_mm} mm off\n{text}"
    cells = [f"{seed}", text[1:].split(" ")[0], f"{mm_s2 / 1e3:g}", prefer or "", f"{first:.2f}", f"{ratio:.4f}"]
    return f"| {' | '.join([*cells, f'{done.feed_s / second:.3f}', f'{total:.4f}'])} |"


@pytest.mark.parametrize(("ends", "more"), [("G0 Z-990", 2.0), ("G1 X60 Y3 A3", 1.0)])
def test_the_last_of_moves_that_turn_leaves_its_corner_by_more_than_p(ends, more):
    """By a closed form: 1.37 P where a rapid follows, P where another move at feed follows."""
    turned_rad = math.radians(3.0)
    x, y = 20.0 + 20.0 * math.cos(turned_rad), 20.0 * math.sin(turned_rad)
    text = f"G21 G90 G94 G64 P0.01\nG0 X0 Y0 Z-1000 A0 B0 C0\nG1 X20 A1 F3000\nG1 X{x:.6f} Y{y:.6f} A2\n{ends}\nM2\n"
    path = read_program(text, "corner.ngc")
    corner = path.poses[path.is_move][1]
    ran = run(text, mm_s2=2000.0, faster=FASTER)
    near = np.abs(ran.poses[:, 0] - corner[0]) < 5.0
    off_mm = off_the_path_mm(Ran(ran.time_s[near], ran.poses[near], ran.line[near]), path)
    expected_mm = 0.01 * beyond_bound(turned_rad, more / math.cos(turned_rad))
    # What servo cycles do: the second begins half of one too early or too late, and the cubic between them.
    assert abs(off_mm - expected_mm) < within_a_cycle_mm(path, 2000.0) / 2.0 + 2000.0 * 1e-6 / 6.0


@pytest.mark.parametrize(("count", "chord_mm", "kink_deg", "mm_s2"), [(1, 0.1, 3.0, 1000.0), (10, 0.15, 2.7, 5000.0)])
def test_short_chords_take_the_time_that_is_reckoned(count, chord_mm, kink_deg, mm_s2, linuxcnc):
    """Within what servo cycles do at each end of a move that stops. Reckoned with the acceleration of lines they were 10 and 4 ms faster."""
    at = np.cumsum(np.exp(1j * np.radians(kink_deg) * np.arange(count + 2)) * np.r_[np.full(count, chord_mm), 5.0, 5.0])
    lines = "\n".join(f"G1 X{end.real:.6f} Y{end.imag:.6f} F1200" for end in at)
    text = f"G21 G90 G94\nG61\nG0 X0 Y0 Z-1000 A0 B0 C0\nG64 P0.01 Q0\n{lines}\nG61\nG1 Z-1001\nM2\n"
    path = read_program(text, "chords.ngc")
    reckoned_s = Planner(mm_s2, linuxcnc.look_ahead).seconds(path).sum()
    # On a busy computer the interpreter falls behind a quick clock for an instant; a wrong reckoning is wrong at any clock.
    for faster in (FASTER, 1):
        off_s = abs(feed_s(run(text, mm_s2=mm_s2, faster=faster), path) - reckoned_s)
        if off_s < 3 * PERIOD_NS / 1e9:
            break
    assert off_s < 3 * PERIOD_NS / 1e9


def _over_a_circle(each: Callable[[int, complex], str]) -> str:
    at = 20.0 * (np.exp(-1j * 0.01 * np.arange(1, 200)) - 1.0) * 1j
    return "\n".join(each(k, point) for k, point in enumerate(at))


MERGED = {
    "a circle": _over_a_circle(lambda _, at: f"G1 X{at.real:.6f} Y{at.imag:.6f}"),
    "with notes and F again": _over_a_circle(
        lambda k, at: f"G1 X{at.real:.6f} Y{at.imag:.6f}" + ("\n(note)\nF3000" if k % 7 == 0 else "")
    ),
    "a zigzag": "\n".join(f"G1 X{0.5 * k:.1f} Y{0.03 * (k % 2):.2f}" for k in range(1, 200)),
    "arcs": "\n".join(f"G{2 + k % 2} X{k + 1} Y0 R5" for k in range(60)),
    "arcs and lines": "\n".join(f"G1 X{k + 0.5} Y0\nG{2 + k % 2} X{k + 1} Y0 R5" for k in range(60)),
}


@pytest.mark.parametrize("name", MERGED)
def test_short_moves_are_merged_as_reckoned(name, linuxcnc):
    """The lines that LinuxCNC runs are those that are reckoned to be queued, and take that time within fifteen servo cycles, on a busy computer too.

    Not merged they would take 8 to 28 ms longer, but for the zigzag at that.
    """
    text = f"G21 G90 G94\nG61\nG0 X0 Y0 Z-1000 A0 B0 C0\nG64 P0.05\nF3000\n{MERGED[name]}\nG61\nG1 Z-1001\nM2\n"
    path = read_program(text, "merged.ngc")
    one = queued(path)
    assert one is not None
    ran = run(text, mm_s2=1000.0, faster=FASTER)
    moves = np.append(np.any(np.diff(ran.poses, axis=0) != 0.0, axis=1), False)
    assert set(ran.line[moves]) - {0} == set(one.path.line[one.path.kind == RowKind.FEED])
    reckoned_s = Planner(1000.0, linuxcnc.look_ahead).seconds(path).sum()
    assert abs(feed_s(ran, path) - reckoned_s) < 15 * PERIOD_NS / 1e9


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, pytest.param(19, marks=pytest.mark.nightly)])
def test_they_keep_their_feed(seed, linuxcnc, crooked):
    check(seed, linuxcnc, crooked)


@pytest.mark.nightly
@pytest.mark.timeout(7200)
def test_so_do_many(linuxcnc, crooked, capsys):
    failed = []
    for seed in range(FIRST, COUNT):
        try:
            row = check(seed, linuxcnc, crooked)
        except AssertionError as error:
            failed.append(str(error).splitlines()[0])
            row = f"| {failed[-1]} |"
        with capsys.disabled():
            print(row, flush=True)  # noqa: T201 - the table of the docs
    assert not failed
