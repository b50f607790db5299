"""The play operator with memory, for several sources."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats


@dataclass(frozen=True, eq=False)
class PlayState:
    """State of m columns in their play.

    Attributes:
        place: output y, in the travel's unit, shape (m,); NaN before the first row.
        side: derivative of y - x by width, -1/2 to 1/2, shape (m,); initially the end given by the first motion.
    """

    place: Floats
    side: Floats


def leaning(travel: Floats) -> PlayState:
    """Return the initial state of a run that begins in motion.

    `side` is -1/2 for a growing column, +1/2 for a shrinking one, 0 at rest.
    """
    side = np.zeros(travel.shape[1])
    _lean(np.ascontiguousarray(travel), side)
    return PlayState(np.full(travel.shape[1], np.nan), side)


def followed(travel: Floats, width: Floats, state: PlayState) -> tuple[Floats, Floats, PlayState]:
    """Apply the play operator: y_k is y_{k-1} limited to x_k - w/2 ... x_k + w/2.

    Returns:
        Error y - x and its derivative by the width, shapes (n, m), and the state after the last row.
    """
    lag, by_width = np.empty_like(travel), np.empty_like(travel)
    place, side = state.place.copy(), state.side.copy()
    _follow(np.ascontiguousarray(travel), width, place, side, lag, by_width)
    return lag, by_width, PlayState(place, side)


@compiled
def _lean(travel: Floats, side: Floats) -> None:
    count, columns = travel.shape
    for i in range(columns):
        k = 1
        while k < count and travel[k, i] == travel[0, i]:
            k += 1
        if k < count:
            side[i] = -0.5 if travel[k, i] > travel[0, i] else 0.5


@compiled
def _follow(
    travel: Floats,
    width: Floats,
    place: Floats,
    side: Floats,
    lag: Floats,
    by_width: Floats,
) -> None:
    count, columns = travel.shape
    for i in range(columns):
        half = 0.5 * width[i]
        at, end = place[i], side[i]
        if count > 0 and np.isnan(at):
            at = travel[0, i] + end * width[i]
        for k in range(count):
            if at < travel[k, i] - half:
                at, end = travel[k, i] - half, -0.5
            elif at > travel[k, i] + half:
                at, end = travel[k, i] + half, 0.5
            lag[k, i] = at - travel[k, i]
            by_width[k, i] = end
        place[i], side[i] = at, end
