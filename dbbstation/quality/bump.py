"""A place where the path leaves its form: a knock, a chip, a pulling cable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.quality.finding import Finding, Name, found
from dbbstation.quality.limits import ROBUST_SHARE, largest_of, scale_of
from dbbstation.trace.gaussian import gaussian

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Floats, Integers

FORM_UPR = 30.0
"""Undulations per revolution that count as form, as in `evaluate`: a bump is shorter, below 12 degrees."""

WIDTHS_DEG = (0.5, 1.0, 2.0, 4.0)
"""Widths that are tried: each is seen by its neighbour at 9/10 of its height or more [deg]."""

REVERSAL_DEG = 6.0
"""How far beside a strut's reversal its step shows in what the filter leaves: half of the shortest form [deg]."""

FEWEST = 3
"""Samples of a stretch, and reversals of a turn, of which a mean or a scatter is taken."""


@dataclass(frozen=True)
class _Peak:
    height_um: float
    limit_um: float
    theta_deg: float
    width_deg: float
    at_reversal: bool

    @property
    def ratio(self) -> float:
        return abs(self.height_um) / self.limit_um if self.limit_um > 0.0 else 0.0


def bump(one: CircleAnalysis, reversals_deg: Sequence[float]) -> Finding:
    """Judge the most outstanding stretch of the path."""
    rest = one.residual_um - gaussian(one.raw.phi_deg, one.residual_um, FORM_UPR)
    near = near_reversals(one.raw.theta_deg, reversals_deg)
    peaks = [peak for width in WIDTHS_DEG for peak in _peaks(one, rest, near, width)]
    if not peaks:
        return found(Name.BUMP, 0.0, np.inf, "µm", "too few samples for stretches of 4 degrees", "")
    worst = max(peaks, key=lambda peak: peak.ratio)
    place = f"{worst.height_um:+.1f} µm over {worst.width_deg:g} degrees at {worst.theta_deg:.0f} degrees"
    beside = ", where a strut turns round" if worst.at_reversal else ""
    return found(
        Name.BUMP,
        abs(worst.height_um),
        worst.limit_um,
        "µm",
        f"nothing sticks out: at most {place}{beside}",
        f"{place}{beside}: look for chips, knocks and cables that pull, and repeat the run",
        f"bump {place}",
    )


def near_reversals(theta_deg: Floats, reversals_deg: Sequence[float], reach_deg: float = REVERSAL_DEG) -> Integers:
    """Return the reversal near each sample, -1 for none, shape (n,)."""
    near = np.full(len(theta_deg), -1, dtype=np.int64)
    for number, place in enumerate(reversals_deg):
        apart = np.abs(theta_deg - place % FULL_TURN_DEG)  # both within a turn: 0 to 360
        near[(apart <= reach_deg) | (apart >= FULL_TURN_DEG - reach_deg)] = number
    return near


def _peaks(one: CircleAnalysis, rest: Floats, near: Integers, width_deg: float) -> list[_Peak]:
    samples = max(round(width_deg / FULL_TURN_DEG * len(rest)), 1)
    if samples < FEWEST and width_deg < WIDTHS_DEG[-1]:
        return []
    sums = np.cumsum(rest)
    means = (sums[samples - 1 :] - np.concatenate([[0.0], sums[:-samples]])) / samples
    middle = np.arange(len(means)) + samples // 2
    theta_deg, beside = one.raw.theta_deg[middle], near[middle]
    # The two ends of the turn do not meet where anything drifted: the filter makes a step of that.
    phi = one.raw.phi_deg[middle]
    inner = (phi > REVERSAL_DEG) & (phi < FULL_TURN_DEG - REVERSAL_DEG)
    found_peaks = []
    away = np.flatnonzero(inner & (beside < 0))
    usual = 0.0
    if len(away) >= FEWEST * samples:
        # Not the noise of the spectrum, which a bump itself makes louder: the median of the stretches does not see one. They
        # overlap, so that fewer are independent: half a width apart they are all but so.
        usual, _ = scale_of(list(means[away]))
        apart = len(away) / samples
        limit = largest_of(2.0 * apart * len(WIDTHS_DEG), ROBUST_SHARE * apart) * usual
        top = _top(means, away)
        found_peaks.append(_Peak(float(means[top]), limit, float(theta_deg[top]), width_deg, at_reversal=False))
    numbers = [n for n in np.unique(beside[inner]) if n >= 0]
    tops = [_top(means, np.flatnonzero(inner & (beside == n))) for n in numbers]
    for k, top in enumerate(tops):
        others = [float(means[t]) for j, t in enumerate(tops) if j != k]
        if len(others) < FEWEST:
            continue
        scale, freedom = scale_of(others)
        limit = largest_of(len(tops) * len(WIDTHS_DEG), freedom) * max(scale, usual)
        found_peaks.append(_Peak(float(means[top]), limit, float(theta_deg[top]), width_deg, at_reversal=True))
    return found_peaks


def _top(means: Floats, among: Integers) -> int:
    return int(among[int(np.argmax(np.abs(means[among])))])
