"""Detect a local departure from the path's form: a knock, a chip, a pulling cable."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import place_of_largest
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.quality.finding import Finding, Name, found
from dbbstation.quality.limits import ROBUST_SHARE, largest_of, scale_of
from dbbstation.trace.gaussian import gaussian

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.circles.analysis import CircleAnalysis
    from dbbstation.computing.arrays import Floats, Integers

FORM_UPR = 30.0
"""Highest undulations per revolution that count as form, as in `evaluate`; bumps are shorter, below 12 degrees."""

WIDTHS_DEG = (0.5, 1.0, 2.0, 4.0)
"""Tried widths [deg]; a bump of another width appears with 9/10 of its height or more."""

REVERSAL_DEG = 6.0
"""Range about a strut's reversal in which its step appears after filtering: half of the shortest undulation [deg]."""

FEWEST = 3
"""Fewest samples of a mean, and fewest reversals of a scatter."""


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
    """Judge the highest bump of the path, relative to its limit."""
    rest = one.residual_um - gaussian(one.raw.phi_deg, one.residual_um, FORM_UPR)
    near = near_reversals(one.raw.theta_deg, reversals_deg)
    peaks = [peak for width in WIDTHS_DEG for peak in _peaks(one, rest, near, width)]
    if not peaks:
        return found(Name.BUMP, 0.0, np.inf, "too few samples for stretches of 4 degrees")
    worst = max(peaks, key=lambda peak: peak.ratio)
    place = f"{worst.height_um:+.1f} µm over {worst.width_deg:g} degrees at {worst.theta_deg:.0f} degrees"
    beside = ", where a strut turns round" if worst.at_reversal else ""
    return found(
        Name.BUMP,
        abs(worst.height_um),
        worst.limit_um,
        f"nothing sticks out: at most {place}{beside}",
        f"{place}{beside}",
        f"bump {place}",
    )


def near_reversals(theta_deg: Floats, reversals_deg: Sequence[float], reach_deg: float = REVERSAL_DEG) -> Integers:
    """Return the number of the reversal near each sample, shape (n,); -1 if no reversal is near."""
    near = np.full(len(theta_deg), -1, dtype=np.int64)
    for number, place in enumerate(reversals_deg):
        apart = np.abs(theta_deg - place % FULL_TURN_DEG)  # both are within 0 to 360
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
    # Drift separates the two ends of the turn, and the filter turns the gap into a step.
    phi = one.raw.phi_deg[middle]
    inner = (phi > REVERSAL_DEG) & (phi < FULL_TURN_DEG - REVERSAL_DEG)
    tops: list[tuple[int, float, bool]] = []
    away = np.flatnonzero(inner & (beside < 0))
    usual = 0.0
    if len(away) >= FEWEST * samples:
        # A bump raises the noise in the spectrum, but not the median of the stretches. Stretches overlap; half a width
        # apart they are nearly independent.
        usual, _ = scale_of(list(means[away]))
        apart = len(away) / samples
        limit = largest_of(2.0 * apart * len(WIDTHS_DEG), ROBUST_SHARE * apart) * usual
        tops.append((largest_at(means, away), limit, False))
    numbers = [n for n in np.unique(beside[inner]) if n >= 0]
    turned = [largest_at(means, np.flatnonzero(inner & (beside == n))) for n in numbers]
    for k, top in enumerate(turned if len(turned) > FEWEST else ()):
        scale, freedom = scale_of([float(means[t]) for j, t in enumerate(turned) if j != k])
        limit = largest_of(len(turned) * len(WIDTHS_DEG), freedom) * max(scale, usual)
        tops.append((top, limit, True))
    return [_Peak(float(means[top]), limit, float(theta_deg[top]), width_deg, turns) for top, limit, turns in tops]


def largest_at(means: Floats, among: Integers) -> int:
    """Return which of the indices `among`, shape (k,), has the value of largest size."""
    return int(among[place_of_largest(np.abs(means[among]))])
