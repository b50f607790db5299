"""Compute minimum zones of many drawn paths at once."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled, inlined

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers

MOST_ROUNDS = 40
"""Rounds of the exchange; traces with noise need five to ten."""

REACHED = 1e-3
"""Largest relative difference between the bounds."""


def strip_widths(outer: Floats, inner: Floats, theta_deg: Floats) -> Floats:
    """Return minimum-zone widths of nearly round paths, shape (draws,), in their unit.

    Args:
        outer: greatest deviation, shape (draws, angles).
        inner: least deviation, shape (draws, angles).
        theta_deg: ascending, shape (angles,).
    """
    # A centre offset (a, b) changes radii by a cos θ + b sin θ; second order is below a nanometre at 0.4 mm. Four
    # alternating points determine the Chebyshev approximation. They are exchanged one at a time [Remez 1934; Cheney,
    # Introduction to Approximation Theory, ch. 3] until lower and upper bound agree.
    theta = np.radians(theta_deg)
    points = _first_points(outer, inner, theta_deg)
    width = np.full(len(outer), np.inf)
    _exchange(np.ascontiguousarray(outer), np.ascontiguousarray(inner), np.cos(theta), np.sin(theta), points, width)
    return width


@compiled
def _exchange(
    outer: Floats,
    inner: Floats,
    cosine: Floats,
    sine: Floats,
    points: Integers,
    width: Floats,
) -> None:
    above, below = np.empty(len(cosine)), np.empty(len(cosine))
    rows = np.empty((4, 5))
    for draw in range(len(outer)):
        high, low, four = outer[draw], inner[draw], points[draw]
        for _ in range(MOST_ROUNDS):
            for k in range(4):
                point, side = four[k], 1.0 - 2.0 * (k % 2)
                rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = 1.0, cosine[point], sine[point], side
                rows[k, 4] = high[point] if side > 0.0 else low[point]
            _solve(rows)
            for k in range(len(cosine)):
                circle = rows[0, 4] + rows[1, 4] * cosine[k] + rows[2, 4] * sine[k]
                above[k], below[k] = high[k] - circle, circle - low[k]
            highest, lowest = np.argmax(above), np.argmax(below)
            out, into = above[highest], below[lowest]
            width[draw] = min(width[draw], out + into)
            if not width[draw] - 2.0 * rows[3, 4] > REACHED * width[draw]:
                break
            _put(four, int(highest if out > into else lowest), 0 if out > into else 1)


@inlined
def _solve(rows: Floats) -> None:
    for column in range(4):
        best = column
        for row in range(column + 1, 4):
            if abs(rows[row, column]) > abs(rows[best, column]):
                best = row
        for k in range(5):
            rows[column, k], rows[best, k] = rows[best, k], rows[column, k]
        for row in range(4):
            if row != column:
                share = rows[row, column] / rows[column, column]
                for k in range(column, 5):
                    rows[row, k] -= share * rows[column, k]
    for row in range(4):
        rows[row, 4] /= rows[row, row]


@inlined
def _put(four: Integers, new: int, kind: int) -> None:
    first, second = four[1 - kind], four[3 - kind]
    most = new
    for k in range(4):
        if four[k] == new:
            return
        most = max(most, four[k])
    # Whether the new point is on the arc from the first point of the other kind to the second.
    size = 1 + most
    is_inside = (new - first) % size <= (second - first) % size
    four[(2 if is_inside else 0) if kind == 0 else (1 if is_inside else 3)] = new


def _first_points(outer: Floats, inner: Floats, theta_deg: Floats) -> Integers:
    sectors = enumerate(pairwise(np.searchsorted(theta_deg, [0.0, 90.0, 180.0, 270.0, 360.0])))
    found = [a + (inner[:, a:b].argmin(axis=1) if k % 2 else outer[:, a:b].argmax(axis=1)) for k, (a, b) in sectors]
    return np.column_stack(found)
