"""Ways of feed-in and feed-out by the readings, the only commanded change of length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.trace.cut import OUTSIDE_FEEDINGS, progress_deg

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.circle import Circle
    from dbbstation.trace.recording import Recording

LEFT_OUT_DEG = 2.0
"""Arc beside a corner in which the machine still gathers speed, or brakes: 20 ms at a feed of 1000 mm/min and 1 m/s² are less, and so is
what a length of 0.3 s at the corner shifts all angles by [deg]."""

READ_DEG = 20.0
"""Arc behind that whose readings say what the length at the corner is [deg]: slow forms are straight or bent on it, not more."""

SHAPE = 2
"""Degree of the polynomial through the readings of that arc."""

FEWEST = 8
"""Readings of an arc: five more than the polynomial has numbers."""


@dataclass(frozen=True)
class FeedingWay:
    """A feed-in or a feed-out.

    Attributes:
        way_um: length outside less at the corner.
    """

    phi_deg: float
    way_um: float
    u_um: float


def feeding_ways(
    recording: Recording, circle: Circle, edges: tuple[float, float]
) -> tuple[FeedingWay, FeedingWay] | None:
    """Return feed-in and feed-out ways by the readings, or None for too few samples."""
    good = recording.good
    phi = progress_deg(good, circle, edges)
    begin = _way(good, circle, good.t_s - edges[0], phi + circle.overshoot_deg)
    end = _way(good, circle, edges[1] - good.t_s, circle.swept_deg - circle.overshoot_deg - phi)
    if begin is None or end is None:
        return None
    return FeedingWay(-circle.overshoot_deg, *begin), FeedingWay(circle.swept_deg - circle.overshoot_deg, *end)


def _way(recording: Recording, circle: Circle, behind_s: Floats, along_deg: Floats) -> tuple[float, float] | None:
    feeding_s = circle.feed_in_mm / (circle.feed_mm_min / 60.0)
    outside = recording.length_mm[(behind_s > -OUTSIDE_FEEDINGS * feeding_s) & (behind_s < -feeding_s)]
    chosen = (along_deg > LEFT_OUT_DEG) & (along_deg < LEFT_OUT_DEG + READ_DEG)
    if not len(outside) or np.count_nonzero(chosen) < FEWEST:
        return None
    columns = np.vander(along_deg[chosen] / READ_DEG, SHAPE + 1, increasing=True)
    found, *_ = np.linalg.lstsq(columns, recording.length_mm[chosen], rcond=None)
    left = recording.length_mm[chosen] - columns @ found
    sigma = float(np.sqrt(left @ left / (len(left) - SHAPE - 1)))
    at_corner = sigma * float(np.sqrt(np.linalg.inv(columns.T @ columns)[0, 0]))
    # Whether the machine stands outside nobody knows: how its readings scatter there counts in full.
    scatter = float(np.std(outside)) if len(outside) > 1 else sigma
    return 1e3 * (float(np.median(outside)) - float(found[0])), 1e3 * float(np.hypot(at_corner, scatter))
