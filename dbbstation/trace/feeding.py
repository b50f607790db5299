"""Measured lengths of feed-in and feed-out, the only commanded changes of length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.trace.cut import OUTSIDE_FEEDINGS, progress_deg

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle
    from dbbstation.trace.recording import Recording

LEFT_OUT_DEG = 2.0
"""Ignored arc beside a corner, where the machine accelerates or brakes [deg]. Acceleration to 1000 mm/min at 1 m/s²
takes 20 ms, which is less; a dwell of 0.3 s shifts angles by less, too."""

READ_DEG = 20.0
"""Following arc, whose readings give the length at the corner [deg]; low undulations are at most parabolic on it."""

SHAPE = 2
"""Degree of the polynomial through the readings of that arc."""

FEWEST = 8
"""Fewest readings of an arc: five more than the polynomial's coefficients."""


@dataclass(frozen=True)
class FeedingWay:
    """A feed-in or a feed-out.

    Attributes:
        way_um: length outside less length at the corner.
    """

    phi_deg: float
    way_um: float
    u_um: float


def feeding_ways(
    recording: Recording, circle: Circle, edges: tuple[float, float]
) -> tuple[FeedingWay, FeedingWay] | None:
    """Return the measured feed-in and feed-out, or None for too few samples."""
    good = recording.good
    phi = progress_deg(good, circle, edges)
    begin = _way(good, circle, good.t_s - edges[0], phi + circle.overshoot_deg)
    end = _way(good, circle, edges[1] - good.t_s, circle.swept_deg - circle.overshoot_deg - phi)
    if begin is None or end is None:
        return None
    return FeedingWay(-circle.overshoot_deg, *begin), FeedingWay(circle.swept_deg - circle.overshoot_deg, *end)


def _way(recording: Recording, circle: Circle, behind_s: Floats, along_deg: Floats) -> tuple[float, float] | None:
    outside = recording.length_mm[(behind_s > -OUTSIDE_FEEDINGS * circle.feeding_s) & (behind_s < -circle.feeding_s)]
    chosen = (along_deg > LEFT_OUT_DEG) & (along_deg < LEFT_OUT_DEG + READ_DEG)
    if not len(outside) or np.count_nonzero(chosen) < FEWEST:
        return None
    columns = np.vander(along_deg[chosen] / READ_DEG, SHAPE + 1, increasing=True)
    found, *_ = np.linalg.lstsq(columns, recording.length_mm[chosen], rcond=None)
    left = recording.length_mm[chosen] - columns @ found
    sigma = float(np.sqrt(left @ left / (len(left) - SHAPE - 1)))
    at_corner = sigma * float(np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0]))
    # The machine may move outside, so the scatter of readings there counts in full, not divided by sqrt(n).
    scatter = float(np.std(outside)) if len(outside) > 1 else sigma
    return 1e3 * (float(np.median(outside)) - float(found[0])), 1e3 * float(np.hypot(at_corner, scatter))
