"""Play between drive and load: the play operator, and the load that is missing within the play."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled
from dbbstation.laws.contract import Parameter, Scale, ScaledSource, SourceForm, Texts

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats

EQUATION = "y_k = min(max(y_k-1, x_k - w/2), x_k + w/2)"
"""The play operator [hysteresis of play, Krasnosel'skii and Pokrovskii 1983]."""

FORM_UNCERTAINTY = 0.2
"""Relative standard deviation of real plays: contacts close gradually, friction and wear differ along the travel, between
directions and with the load, and play is seldom the same at both ends."""

MOST_OF_COULOMB = 1.5
"""Largest friction after a reversal over Coulomb friction: 2.5 standard deviations of the formula's inaccuracy."""

GAP_SHARES = (0.002, 0.004, 0.008, 0.016, 0.03, 0.06, 0.12, 0.24)
"""Tried plays, over the travel."""

RISES = (0.25, 1.0, 2.0)
"""Tried travels over which the load returns, over the play."""


class LostMotion(ScaledSource):
    """After a reversal the load is missing until the play is crossed: F = -F_l sign(v) r(d).

    r is 1 within the travel g, then falls to 0 over w. If F_l equals the Coulomb friction, all friction is behind the
    play.
    """

    name = "lost-motion"
    needs = ("since_reversal_mm", "direction")
    form_uncertainty = FORM_UNCERTAINTY
    texts = Texts(
        what="Between drive and load there is play or an elastic lash: after a reversal the drive moves over it before "
        "the load, or its friction, is felt.",
        shows="After every reversal the force stays near zero over the same travel before it rises to its new level.",
        confirm="Reverse slowly and read force over position: a flat stretch near zero force of the same length at both "
        "ends; measure the load itself with a dial gauge.",
        cure="Preload nut and couplings; replace worn joints; backlash compensation in the control.",
        equation="F = -F_l sign(v) r(d), r = 1 for d < g, then falling to 0 over w, d the travel since the reversal",
        origin="Nordin and Gutman, Controlling mechanical systems with backlash, Automatica 38 (2002) 1633, sec. 2",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        if not (scale.reverses and scale.both_ways):
            return ()
        size = Parameter("lost_n", "N", 0.5 * scale.force_n, "force that is missing within the play", positive=True)
        gaps = tuple(1e3 * share * scale.travel_m for share in GAP_SHARES)
        gap = Parameter("gap_mm", "mm", 1e3 * 0.03 * scale.travel_m, "play", gaps)
        rise = Parameter("rise_per_gap", "1", 1.0, "way over which the load comes back, over the play", RISES)
        return (SourceForm((size, gap, rise), _missing),)

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        return values["lost_n"] <= MOST_OF_COULOMB * max(values.get("coulomb_n", 0.0), 0.0)


def _missing(variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
    gap_mm, rise = shapes["gap_mm"], shapes["rise_per_gap"]
    share = np.clip((gap_mm * (1.0 + rise) - variables["since_reversal_mm"]) / (gap_mm * rise), 0.0, 1.0)
    return -(variables["direction"] * share)[:, None]


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


def followed(
    travel: Floats, width: Floats, state: PlayState | None = None, load: Floats | None = None, friction: float = np.inf
) -> tuple[Floats, Floats, PlayState]:
    """Apply the play operator: y_k is y_{k-1} limited to x_k - w/2 ... x_k + w/2.

    Args:
        state: None for a run that begins in motion.
        load: on the driven side, shape (n, m); beyond the friction, it holds the play at the end of its sign.

    Returns:
        Error y - x and its derivative by the width, shapes (n, m), and the state after the last row.
    """
    lag, by_width = np.empty_like(travel), np.empty_like(travel)
    state = state or leaning(travel)
    place, side = state.place.copy(), state.side.copy()
    load = np.zeros_like(travel) if load is None else np.ascontiguousarray(load)
    _follow(np.ascontiguousarray(travel), load, width, friction, place, side, lag, by_width)
    return lag, by_width, PlayState(place, side)


def resistance(travel: Floats, width: float, state: PlayState | None = None) -> tuple[Floats, PlayState]:
    """Return the share of friction that opposes motion, -1 to 1, shape (n, m), and the state after the last row.

    Friction turns round over `width`: a spring that slides at its ends [stop operator; Visintin, Differential Models of
    Hysteresis, 1994, sec. III.2].
    """
    lag, _, behind = followed(travel, np.full(travel.shape[1], width), state)
    return 2.0 * lag / width, behind


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
    load: Floats,
    width: Floats,
    friction: float,
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
            x, force = travel[k, i], load[k, i]
            error = at - x
            if force < -friction or (force <= friction and error < -half):
                error, at, end = -half, x - half, -0.5
            elif force > friction or error > half:
                error, at, end = half, x + half, 0.5
            lag[k, i], by_width[k, i] = error, end
        place[i], side[i] = at, end


def limited(apart: float, half: float) -> float:
    """Return output minus input of a play of half width `half`, from their distance had the output stood still."""
    return half if apart > half else max(apart, -half)


def within(values: Floats, blocks: Sequence[slice], width: float) -> Floats:
    """Return the position within a play, -1 to 1, shape (n,) [play operator; Visintin, Differential Models of Hysteresis, 1994, sec. III.2]; blocks start in the middle."""
    found = np.empty(len(values))
    for rows in blocks:
        own = values[rows]
        rises = np.diff(own) >= 0.0
        turns = np.concatenate([[0], np.flatnonzero(rises[1:] != rises[:-1]) + 1])
        # Between turning points motion is monotonic, so the position follows from the last turning point.
        there, last = [0.0], 0.0
        for change in np.diff(own[turns]).tolist():
            last = limited(last + 2.0 * change / width, 1.0)
            there.append(last)
        leg = np.searchsorted(turns, np.arange(len(own)), side="right") - 1
        found[rows] = np.clip(np.array(there)[leg] + 2.0 * (own - own[turns][leg]) / width, -1.0, 1.0)
    return found
