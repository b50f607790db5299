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
"""Three points lie on one circle: the zone of fewer than four has no width and no place."""

SECTORS = 6
"""Parts of the turn whose highest and lowest points the search begins with: the four that touch lie apart."""

AGREED_MM = 1e-10
"""Width by which a point may stick out of the zone: far below what any bar resolves [mm]."""

MOST_ROUNDS = 60
"""Rounds of the search. Traces with noise need five to fifteen."""

PARALLEL = 1e-12
"""Sine below which two bisectors are parallel: they meet nowhere."""


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

    Two outer and two inner points determine it, with crossing chords [Rivlin, Approximation by circles, Computing 21
    (1979)]; its centre is where two bisectors meet. All pairs of a few points are tried, and protruding points join them
    until none is left.

    Raises:
        TraceError: fewer than four different points.
    """
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
    # Sorting all points takes longer than the search: those of a sound path differ from the first.
    first = points_mm[:FEWEST_POINTS]
    if len(np.unique(first, axis=0)) < FEWEST_POINTS and len(np.unique(points_mm, axis=0)) < FEWEST_POINTS:
        raise TraceError("it has fewer than four points", remedy="record more of the turn")
    middle = points_mm.mean(axis=0)
    x, y = (points_mm - middle).T
    radius = np.hypot(x, y)
    sector = ((np.arctan2(y, x) / (2.0 * np.pi) + 0.5) * SECTORS).astype(np.int64)
    found = [np.arange(min(FEWEST_POINTS, len(points_mm)))]
    for one in range(SECTORS):
        inside = np.flatnonzero(sector == one)
        if len(inside):
            found.append(inside[[np.argmax(radius[inside]), np.argmin(radius[inside])]])
    return np.unique(np.concatenate(found))


def _best_centre(points_mm: Floats) -> Floats:
    """Return the zone's centre for a few points by all bisector crossings, shape (2,) [mm]."""
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
    # The zone of four points that lie far apart is no wider than that of all: most centres are out by it.
    outermost = points_mm[np.concatenate([points_mm.argmin(axis=0), points_mm.argmax(axis=0)])]
    at_least = _widths(centres, outermost)
    likely = int(np.argmin(at_least))
    centres = centres[at_least <= _widths(centres[likely : likely + 1], points_mm)[0]]
    return np.asarray(centres[np.argmin(_widths(centres, points_mm))])


def _widths(centres_mm: Floats, points_mm: Floats) -> Floats:
    # Points first: ranges are then taken row by row of a thousand centres, not centre by centre of a dozen points.
    across, along = (points_mm[:, k, None] - centres_mm[:, k] for k in (0, 1))
    return np.asarray(np.ptp(np.sqrt(across * across + along * along), axis=0))
