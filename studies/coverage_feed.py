"""Does U of the shown feed contain the feed? Recordings of `tests/plant/serial.py`."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.analysis import analyse
from dbbstation.errors import TraceError
from dbbstation.plan.plan import Circle, Direction
from dbbstation.trace.cut import cut
from dbbstation.trace.recording import Recording
from studies.coverage_rows import row_of
from studies.kept_draws import drawn
from tests.plant.noise import Noise
from tests.plant.serial import Axis, SerialMachine

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from studies.coverage_rows import Row

CIRCLE = Circle((0, 0, 0), (0, 0, 0), 150.0, (0, 0, 0), 1000.0, 0.0, 45.0, 1.5, 0.0, Direction.CCW)
RATE_HZ = 20.0
DWELL_S = 0.3
FEED_SHARE = 2e-3
"""Standard deviation of what the feed is off by; cutting refuses twice of it."""

NOISES = (Noise(0.3), Noise(1.0), Noise(0.18, 0.24, 0.8), Noise(0.6, 0.8, 0.8))
"""White and correlated from sample to sample, 0.3 and 1 µm."""

COVERAGE_FACTOR = 2.0
"""k of U = k u."""

FIGURE = "feed shown"


def coverage_of_feed(draws: int, seed: int, progress: Callable[[int], None], keep: Path | None = None) -> list[Row]:
    """Draw recordings and count how often U = 2 u contains the true feed.

    Args:
        draws: noises in turn.
        keep: file of draws, or None.
    """
    found = []
    for number, one in enumerate(drawn(partial(_numbered, seed), range(draws), keep, f"feeds, from seed {seed}")):
        found.append(one)
        progress(number + 1)
    off, u = (np.array([[one[k]] for one in found], dtype=np.float64) for k in (0, 1))
    return [row_of("turn and overlap of 45 degrees", FIGURE, off, u, "mm/min", within=COVERAGE_FACTOR)]


def _numbered(seed: int, number: int) -> tuple[float | None, float | None]:
    return drawn_feed(seed + number)


def drawn_feed(seed: int) -> tuple[float | None, float | None]:
    """Return found less true feed and standard uncertainty [mm/min]; None without a shown feed."""
    rng = np.random.default_rng([seed, 31])
    feed_mm_min = CIRCLE.feed_mm_min * (1.0 + FEED_SHARE * float(rng.standard_normal()))
    scale, square = 100.0 * rng.standard_normal(2)
    machine = SerialMachine(Axis(scale_um_m=float(scale)), Axis(scale_um_m=-float(scale)), float(square))
    ball_mm = 0.05 * rng.standard_normal(2)
    turning_deg_s = float(np.degrees(feed_mm_min / 60.0 / CIRCLE.radius_mm))
    feeding_s, arc_s = CIRCLE.feed_in_mm / (feed_mm_min / 60.0), CIRCLE.swept_deg / turning_deg_s
    start_s = 1.0 + feeding_s + DWELL_S
    t_s = np.arange(0.0, start_s + arc_s + DWELL_S + feeding_s + 1.0, 1.0 / RATE_HZ)
    theta_deg = CIRCLE.theta_deg(np.clip((t_s - start_s) * turning_deg_s, 0.0, CIRCLE.swept_deg) - CIRCLE.overshoot_deg)
    end_s = start_s + arc_s + DWELL_S
    outside = np.interp(t_s, [1.0, 1.0 + feeding_s], [1.0, 0.0]) + np.interp(
        t_s, [end_s, end_s + feeding_s], [0.0, 1.0]
    )
    length_mm = machine.length_mm(
        theta_deg, CIRCLE.radius_mm, feed_mm_min, int(CIRCLE.direction.sign), (float(ball_mm[0]), float(ball_mm[1]))
    )
    noise_mm = NOISES[seed % len(NOISES)].drawn_mm(rng, len(t_s))
    recording = Recording("a run", t_s, length_mm + CIRCLE.feed_in_mm * outside + noise_mm)
    try:
        shown = analyse(cut(recording, CIRCLE), recording).feed_mm_min
    except TraceError:  # a feed that is refused is not printed
        shown = None
    return (None, None) if shown is None else (shown[0] - feed_mm_min, shown[1])
