"""What LinuxCNC's planner makes of programs as other people write them, nominal and compensated: time and path.

`DBBSTATION_LOOK_ALIKES=200` runs as many in the nightly test, which prints a row for each.
"""

from __future__ import annotations

import os

import numpy as np
import pytest

from dbbstation.errors import StationError
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.export import Inverse, compensated_program
from dbbstation.nc.planner import KEPT
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import RowKind, Toolpath
from tests.nc.look_alikes import STYLES, look_alike
from tests.nc.planner.linuxcnc import PERIOD_NS, Ran, missing, run
from tests.nc.planner.required import needs
from tests.nc.test_on_the_planner import accelerating, allowed_mm, judged

REASON = missing()
pytestmark = [
    needs(REASON),
    # There is one LinuxCNC on a computer at a time.
    pytest.mark.xdist_group("linuxcnc"),
]

FASTER = 5
ACCELERATIONS_MM_S2 = (500.0, 1000.0, 2000.0, 5000.0)
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
    ran, off_mm = (
        judged(done.text, read, mm_s2, FASTER) if bounded else (run(done.text, mm_s2=mm_s2, faster=FASTER), 0.0)
    )
    first, second = feed_s(nominal, path), feed_s(ran, read)
    ratio, total = second / first, ran.moving_s / nominal.moving_s
    assert ratio <= KEPT, f"seed {seed}: {first} s at feed, compensated {second} s\n{text}"
    if bounded:
        assert off_mm < allowed_mm(read, mm_s2) + within_a_cycle_mm(read, mm_s2), (
            f"seed {seed}: {off_mm} mm off\n{text}"
        )
    cells = [f"{seed}", text[1:].split(" ")[0], f"{mm_s2 / 1e3:g}", prefer or "", f"{first:.2f}", f"{ratio:.4f}"]
    return f"| {' | '.join([*cells, f'{done.feed_s / second:.3f}', f'{total:.4f}'])} |"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, 19])
def test_they_keep_their_feed(seed, linuxcnc, crooked):
    """A pocket and drilled holes."""
    check(seed, linuxcnc, crooked)


@pytest.mark.nightly
@pytest.mark.timeout(7200)
def test_so_do_many(linuxcnc, crooked, capsys):
    for seed in range(COUNT):
        row = check(seed, linuxcnc, crooked)
        with capsys.disabled():
            print(row, flush=True)  # noqa: T201 - the table of the docs
