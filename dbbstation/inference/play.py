"""Play: where a thing is within a gap as it is pushed to and fro, and laws of gaps so wide that it is on its way for long.

Half of a play beside a fast reversal is a sign that turns; a wide one remembers where the variable turned.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.channel import Law
from dbbstation.inference.memory import late_odds, start_of, starts_of
from dbbstation.inference.patterns import TRANSITS, Family, play
from dbbstation.inference.variables import Kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.variables import Variable

WIDTHS = tuple(float(TRANSITS[-1] * 2.0 ** (k / 2.0)) for k in range(1, 7))
"""Widths of a play that are tried at first, in shares of the range: from half an octave above those of hysteresis to 0.8. Half an
octave is as close as the others are; each is then moved to where it fits best."""


def play_laws(variables: Sequence[Variable], blocks: Sequence[slice], size: float, unit: str) -> list[Law]:
    """A wide play in each variable that is sampled along a path and turns.

    Args:
        variables: that an effect may follow.
        blocks: rows of each, in time order.
        size: of an effect, one standard deviation, in the unit of the residual.
        unit: of the residual.
    """
    usable = [
        v for v in variables if v.kind is not Kind.TIME and v.extent > 0.0 and v.is_path(blocks) and _turns(v, blocks)
    ]
    starts = starts_of(blocks)
    return [
        Law(
            name=f"{Family.PLAY} of {variable.name}",
            columns=partial(_columns, variable, blocks),
            plausible=np.full(1 + starts, size),
            parameters=("half width", *(f"start {k + 1}" for k in range(starts)), "way"),
            units=(*[unit] * (1 + starts), variable.unit),
            grids=(tuple(width * variable.extent for width in WIDTHS),),
            log_odds=late_odds(len(usable)),
            reach=size,
            family=Family.PLAY,
            variables=(variable,),
        )
        for variable in usable
    ]


def _turns(variable: Variable, blocks: Sequence[slice]) -> bool:
    return {-1.0, 1.0} <= set(variable.directions(blocks).tolist())


def _columns(variable: Variable, blocks: Sequence[slice], point: tuple[float, ...]) -> NDArray[np.float64]:
    """Place within a gap where each block begins in its middle, and what it is more where it begins at a side, shape (n, 1 + starts)."""
    values = np.empty(len(variable.values))
    for rows in blocks:
        values[rows] = variable.travel(rows)
    found = np.zeros((len(values), 1 + starts_of(blocks)))
    found[:, 0] = play(values, blocks, point[0])
    # Until a side is reached the beginning is remembered.
    side = 0.5 * (play(values, blocks, point[0], 1.0) - play(values, blocks, point[0], -1.0))
    for k, rows in enumerate(blocks):
        found[rows, 1 + start_of(k, blocks)] = side[rows]
    return found
