"""In how many seconds of motion a length that sticks, or a gauge at its stop, is recognised; and how often sound turns are taken for one.

`python -m tests.quality.standing` prints the table of docs/validation.md.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from dbbstation.quality.held import HeldLength
from dbbstation.quality.limits import SHARE
from tests.quality.test_held import TURN_S, readings, stuck

RATES_HZ = (5.0, 10.0, 50.0, 250.0, 1000.0)
STEPS = (0.1, 0.5, 1.0, 2.0)
"""Steps of the readings, as shares of the standard deviation of their white noise."""

WHITE_UM = 0.4


def recognised_s(watch: HeldLength, t_s: np.ndarray, length_mm: np.ndarray) -> float | None:
    for t, length in zip(t_s.tolist(), length_mm.tolist(), strict=True):
        watch.add(t, length)
        if watch.stands(len(t_s)):
            return float(t)
    return None


def at_its_stop(t_s: np.ndarray, length_mm: np.ndarray, form_um: np.ndarray, share: float) -> tuple[np.ndarray, float]:
    """Readings that go no farther than a stop, and since when the length stands at it for good: its noise goes no lower than that."""
    stop_mm = float(np.quantile(length_mm, share))
    clipped = np.minimum(length_mm, stop_mm)
    # What moves it off the stop is noise as long as the form is below three standard deviations above it.
    beyond = form_um > 1e3 * (stop_mm - 150.0) + 3.0 * np.hypot(WHITE_UM, 0.4)
    return clipped, float(t_s[beyond][0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=100)
    parser.add_argument("--seed", type=int, default=34)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    sys.stdout.write(
        "| rate [1/s] | step / noise | stuck: median, 95 %, longest [s] | stop: median, 95 %, longest [s] | not seen | sound turns taken for one |\n"
    )
    sys.stdout.write("| --- | --- | --- | --- | --- | --- |\n")
    for rate_hz in RATES_HZ:
        for step in STEPS:
            stuck_s, stop_s, missed, alarms = [], [], 0, 0
            turns = given.turns if rate_hz <= 50.0 else max(given.turns // 10, 1)
            for turn in range(turns):
                t_s, length_mm = readings([given.seed, turn], rate_hz, WHITE_UM, step_um=step * WHITE_UM, form_um=-20.0)
                phi = 2.0 * np.pi * t_s / TURN_S
                form_um = -20.0 * (np.cos(2.0 * phi) + 0.3 * np.sin(3.0 * phi))
                before = HeldLength()
                alarms += recognised_s(before, t_s, length_mm) is not None
                # The run before has shown the noise; it is kept.
                at_s = float(rng.uniform(1.0, TURN_S - 5.0))
                for series, (spoilt, since_s) in (
                    (stuck_s, (stuck(t_s, length_mm, at_s), at_s)),
                    (stop_s, at_its_stop(t_s, length_mm, form_um, float(rng.uniform(0.3, 0.8)))),
                ):
                    before.restart()
                    seen_s = recognised_s(before, t_s, spoilt)
                    if seen_s is None:
                        missed += 1
                    else:
                        series.append(max(seen_s - since_s, 0.0))
            cells = [_cell(stuck_s), _cell(stop_s)]
            sys.stdout.write(
                f"| {rate_hz:g} | {step:g} | {' | '.join(cells)} | {missed} of {2 * turns} | {alarms} of {turns} |\n"
            )
            sys.stdout.flush()
    sys.stdout.write(f"probability of a sound turn, at the most: {SHARE:.1e}\n")


def _cell(seconds: list[float]) -> str:
    if not seconds:
        return ""
    return f"{np.median(seconds):.1f}, {np.quantile(seconds, 0.95):.1f}, {max(seconds):.1f}"


if __name__ == "__main__":
    main()
