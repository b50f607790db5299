"""Motion before sliding, with memory: the play operator and Dahl's law.

[Dahl, A solid friction model, Aerospace Corporation TOR-0158(3107-18)-1 (1968), eq 1 with exponent 1]
"""

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


@dataclass(frozen=True, eq=False)
class WoundState:
    """Wind-up of m columns.

    Attributes:
        travel: last position, in its unit, shape (m,); NaN before the first row.
        side: wind-up over the whole width, -1/2 to 1/2, shape (m,).
        by_length: derivative of `side` by length, shape (m,).
    """

    travel: Floats
    side: Floats
    by_length: Floats


def wound(travel: Floats) -> WoundState:
    """Return the initial state of a run that begins in motion."""
    start = leaning(travel)
    return WoundState(start.place, start.side, np.zeros_like(start.side))


def wound_up(travel: Floats, length: Floats, state: WoundState) -> tuple[Floats, Floats, WoundState]:
    """Return the wind-up z, with dz = -(s/2 + z) |dx| / l and s the sign of dx.

    Returns:
        z and its derivative by l, shapes (n, m), and the state after the last row.
    """
    side, by_length = np.empty_like(travel), np.empty_like(travel)
    at, now, slope = state.travel.copy(), state.side.copy(), state.by_length.copy()
    _wind(np.ascontiguousarray(travel), length, at, now, slope, side, by_length)
    return side, by_length, WoundState(at, now, slope)


@compiled
def _wind(
    travel: Floats,
    length: Floats,
    at: Floats,
    now: Floats,
    slope: Floats,
    side: Floats,
    by_length: Floats,
) -> None:
    count, columns = travel.shape
    for i in range(columns):
        x, z, dz, own = at[i], now[i], slope[i], length[i]
        for k in range(count):
            way = 0.0 if np.isnan(x) else travel[k, i] - x
            if way != 0.0:
                end = -0.5 if way > 0.0 else 0.5
                kept = np.exp(-abs(way) / own)
                dz = kept * (dz + (z - end) * abs(way) / (own * own))
                z = end + (z - end) * kept
            x = travel[k, i]
            side[k, i], by_length[k, i] = z, dz
        at[i], now[i], slope[i] = x, z, dz
