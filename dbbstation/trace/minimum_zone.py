"""The minimum zone: two concentric circles of least separation around a path."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TraceError

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers

FEWEST_POINTS = 4
"""Three points are always on one circle, so a zone needs four."""

SECTORS = 4
"""The search starts with the highest and lowest point of each sector, because the four touching points are far apart.
Six sectors take twice the time of four, with equal zones."""

AGREED_MM = 1e-10
"""A point may protrude this far from the zone: much less than a bar's resolution [mm]."""

MOST_ROUNDS = 60
"""Rounds of the search. Traces with noise need five to fifteen."""

PARALLEL = 1e-12
"""Sine of the angle below which two bisectors count as parallel."""


@dataclass(frozen=True)
class MinimumZone:
    """Two concentric circles.

    Attributes:
        centre_mm: (x, y).
    """

    centre_mm: tuple[float, float]
    inner_mm: float
    outer_mm: float

    @property
    def width_mm(self) -> float:
        """Return their radial separation [mm]."""
        return self.outer_mm - self.inner_mm


def minimum_zone(points_mm: Floats) -> MinimumZone:
    """Return the exact minimum zone of a closed path.

    Raises:
        TraceError: fewer than four different points.
    """
    # Two outer and two inner points with crossing chords determine it [Rivlin, Approximation by circles, Computing 21
    # (1979)]; its centre is the intersection of two bisectors. The search tries all pairs of a few points and adds
    # protruding points until no point protrudes.
    points_mm = np.asarray(points_mm, dtype=np.float64)
    chosen = _extremes(points_mm)
    for _ in range(MOST_ROUNDS):
        centre = _best_centre(points_mm[chosen])
        distance = np.hypot(*(points_mm - centre).T)
        near, far = int(np.argmin(distance)), int(np.argmax(distance))
        within = distance[chosen]
        if distance[far] - distance[near] <= np.ptp(within) + AGREED_MM:
            return MinimumZone((float(centre[0]), float(centre[1])), float(distance[near]), float(distance[far]))
        chosen = np.unique([*chosen, near, far])
    raise TraceError("its minimum zone was not found", remedy="report this recording: this is a fault of the program")


def _extremes(points_mm: Floats) -> Integers:
    # Sorting all points takes longer than the search, so the first points are checked before.
    first = points_mm[:FEWEST_POINTS]
    if len(np.unique(first, axis=0)) < FEWEST_POINTS and len(np.unique(points_mm, axis=0)) < FEWEST_POINTS:
        raise TraceError("it has fewer than four points", remedy="record more of the turn")
    middle = points_mm.mean(axis=0)
    x, y = (points_mm - middle).T
    radius = np.hypot(x, y)
    sector = ((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * SECTORS).astype(np.int64)
    found = []
    for one in range(SECTORS):
        inside = np.flatnonzero(sector == one)
        if len(inside):
            found.append(inside[[np.argmax(radius[inside]), np.argmin(radius[inside])]])
    if len(found) < FEWEST_POINTS:
        found.append(np.arange(FEWEST_POINTS))
    return np.unique(np.concatenate(found))


def _best_centre(points_mm: Floats) -> Floats:
    """Return the best centre for a few points among all bisector intersections, shape (2,) [mm]."""
    pairs = np.array(list(combinations(range(len(points_mm)), 2)))
    first, second = points_mm[pairs[:, 0]], points_mm[pairs[:, 1]]
    along = second - first
    length = np.hypot(along[:, 0], along[:, 1])
    apart = length > 0.0
    along, middle = along[apart] / length[apart, None], (0.5 * (first + second))[apart]
    offset = np.sum(along * middle, axis=1)
    one, other = np.triu_indices(len(along), 1)
    sine = along[one, 0] * along[other, 1] - along[one, 1] * along[other, 0]
    meet = np.abs(sine) > PARALLEL
    one, other, sine = one[meet], other[meet], sine[meet]
    x = (offset[one] * along[other, 1] - offset[other] * along[one, 1]) / sine
    y = (along[one, 0] * offset[other] - along[other, 0] * offset[one]) / sine
    centres = np.column_stack([x, y])
    # The zone of four distant points is at most as wide as the zone of all, so it excludes most centres.
    outermost = points_mm[np.concatenate([points_mm.argmin(axis=0), points_mm.argmax(axis=0)])]
    at_least = _widths(centres, outermost)
    likely = int(np.argmin(at_least))
    centres = centres[at_least <= _widths(centres[likely : likely + 1], points_mm)[0]]
    return centres[np.argmin(_widths(centres, points_mm))]


def _widths(centres_mm: Floats, points_mm: Floats) -> Floats:
    # Points are the first axis, so NumPy computes ranges over long rows of centres.
    across, along = (points_mm[:, k, None] - centres_mm[:, k] for k in (0, 1))
    return np.ptp(np.sqrt(across * across + along * along), axis=0)
