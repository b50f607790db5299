"""Motion before sliding, with memory: Dahl's law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled, inlined
from dbbstation.laws.contract import Parameter, Scale, ScaledSource, SourceForm, Texts
from dbbstation.laws.play import MOST_OF_COULOMB, leaning

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats

DAHL = "Dahl, A solid friction model, Aerospace Corporation TOR-158 (1968)"

WIND_UP = "dz = -(s/2 + z) |dx| / l, s the direction"
"""Dahl's law with exponent 1 [eq 1]; at the distance d after a reversal of what is fully wound, z = -s (1/2 - exp(-d / l))."""

LENGTH_SHARES = (0.0005, 0.001, 0.002, 0.004, 0.008, 0.016, 0.03, 0.06)
"""Tried lengths of the build-up, over the travel."""


class Presliding(ScaledSource):
    """Friction reverses over a travel: F = -2 F_p sign(v) exp(-d / d_0).

    With Coulomb friction F_p it is Dahl's F = F_c sign(v) (1 - 2 exp(-d / d_0)), d since the reversal.
    """

    name = "presliding"
    needs = ("since_reversal_mm", "direction")
    form_uncertainty = 0.2  # friction builds up only approximately exponentially
    texts = Texts(
        what="Contacts, balls and seals yield elastically before they slide: after a reversal friction turns round "
        "over a short travel, not at once.",
        shows="After every reversal the force approaches its new level along the travel, at slow and at fast reversals "
        "over the same travel.",
        confirm="Reverse slowly at one place with strokes of 0.05 to 1 mm and plot force over position: loops that are "
        "rounded at their corners.",
        cure="A stiffer support of seals and bearings; in the control a reversal compensation that depends on travel.",
        equation="F = -2 F_p sign(v) exp(-d / d_0), d the travel since the reversal",
        origin=f"{DAHL}; Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        if not scale.reverses:
            return ()
        size = Parameter(
            "presliding_n", "N", 0.2 * scale.force_n, "friction still to turn round at reversal", positive=True
        )
        lengths = tuple(1e3 * share * scale.travel_m for share in LENGTH_SHARES)
        meaning = "travel after which 37 % are left of it"
        length = Parameter("length_mm", "mm", 1e3 * 0.01 * scale.travel_m, meaning, lengths)
        return (
            SourceForm(
                (size, length),
                lambda v, k: -2.0 * (v["direction"] * to_turn(v["since_reversal_mm"], k[length.name]))[:, None],
            ),
        )

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        return values["presliding_n"] <= MOST_OF_COULOMB * max(values.get("coulomb_n", 0.0), 0.0)


def to_turn(travel: Floats, length: float) -> Floats:
    """Return the share of friction that has not turned round after a travel."""
    return np.exp(-travel / length)


_to_turn = inlined(to_turn)


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
                kept = _to_turn(np.abs(way), own)
                dz = kept * (dz + (z - end) * abs(way) / (own * own))
                z = end + (z - end) * kept
            x = travel[k, i]
            side[k, i], by_length[k, i] = z, dz
        at[i], now[i], slope[i] = x, z, dz
