"""Effects with memory: first-order lag or dead time."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_banded

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Law
from dbbstation.inference.patterns import Family, log_odds, odds_of_driven
from dbbstation.inference.variables import Kind

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.patterns import Choices
    from dbbstation.inference.variables import Variable

SHORTEST_ROWS = 2.0
"""Shortest time constant in rows; faster effects are no memory."""

LONGEST_SHARE = 1.0 / 3.0
"""Longest time constant over the longest block; of longer ones only the drift at the start is visible."""

LONGEST_DELAY_SHARE = 0.1
"""Longest dead time over the longest block; earlier rows contain no information on it."""

LATE = 0.1
"""Prior probability that an effect has a visible delay of either kind. Over a slow variable any delay is invisible, and
the effect is called linear."""

AT_ONCE = 0.5
"""Prior probability that the simulation contains the effect without delay; the residual is then the delayed minus the immediate effect."""


def memory_laws(
    variables: Sequence[Variable],
    time: Floats,
    time_unit: str,
    blocks: Sequence[slice],
    size: float,
    unit: str,
) -> list[Law]:
    """Return laws with lag and dead time for each path variable."""
    usable = [v for v in variables if v.kind is not Kind.TIME and v.extent > 0.0 and v.is_path(blocks)]
    moving = [rows for rows in blocks if rows.stop - rows.start > 1]
    steps = [np.diff(time[rows]) for rows in moving]
    if not usable or min((float(step.min()) for step in steps), default=0.0) <= 0.0:
        return []
    row = float(np.median(np.concatenate(steps)))
    longest = max(float(np.sum(step)) for step in steps)
    kinds = (
        (Family.MEMORY, "time constant", _lag, _grid(SHORTEST_ROWS * row, LONGEST_SHARE * longest)),
        (Family.DEAD_TIME, "dead time", _delay, _grid(row, LONGEST_DELAY_SHARE * longest)),
    )
    found = []
    for family, parameter, columns, grid in kinds:
        for variable in usable if grid else ():
            gain = size / variable.half_range
            starts = starts_of(blocks) if family is Family.MEMORY else 0
            found.append(
                Law(
                    name=f"{family} of {variable.name}",
                    columns=partial(columns, variable, time, blocks),
                    plausible=np.array([gain, gain, *[size] * starts]),
                    parameters=("gain", "gain", *(f"start {k + 1}" for k in range(starts)), parameter),
                    units=(
                        *(f"{unit}/{variable.unit}" if variable.unit else unit for _ in range(2)),
                        *[unit] * starts,
                        time_unit,
                    ),
                    grids=(grid,),
                    log_odds=log_odds(len(usable)) + float(np.log(LATE / len(kinds))) + odds_of_driven([variable]),
                    choices=_choices(2 + starts),
                    reach=size,
                    family=family,
                    variables=(variable,),
                )
            )
    return found


def _choices(width: int) -> Choices:
    """Return two choices: the simulation lacks the effect, or has it without delay; both with initial states."""
    starts = tuple(range(2, width))
    return (
        ((0, *starts), float(np.log(1.0 - AT_ONCE)), "which the simulation lacks"),
        ((1, *starts), float(np.log(AT_ONCE)), "which the simulation has at once"),
    )


def _grid(shortest: float, longest: float) -> tuple[float, ...]:
    return tuple(np.geomspace(shortest, longest, BOUNDS.memory_lengths).tolist()) if longest > 2.0 * shortest else ()


def _lag(variable: Variable, time: Floats, blocks: Sequence[slice], point: tuple[float, ...]) -> Floats:
    """Return delayed values, delayed less present values, and initial transients, shape (n, 2 + starts)."""
    starts = starts_of(blocks)
    found = np.zeros((len(time), 2 + starts))
    for k, rows in enumerate(blocks):
        values, at = variable.travel(rows), time[rows]
        found[rows, 1] = lagging(values, at, point[0])
        found[rows, 0] = values - _middle(variable) + found[rows, 1]
        found[rows, 2 + (k if starts > 1 else 0)] = np.exp(-(at - at[0]) / point[0])
    return found


def starts_of(blocks: Sequence[slice]) -> int:
    """Return the number of a law's initial states: one per run, or one in all if there are many runs."""
    return len(blocks) if len(blocks) <= BOUNDS.memory_starts else 1


def _delay(variable: Variable, time: Floats, blocks: Sequence[slice], point: tuple[float, ...]) -> Floats:
    """Return delayed values and delayed less present values, shape (n, 2); values are constant before the first row."""
    found = np.zeros((len(time), 2))
    for rows in blocks:
        values, at = variable.travel(rows), time[rows]
        ago = np.interp(at - point[0], at, values)
        found[rows] = np.column_stack([ago - _middle(variable), ago - values])
    return found


def _middle(variable: Variable) -> float:
    return 0.5 * (variable.low + variable.high)


def lagging(values: Floats, time: Floats, constant: float) -> Floats:
    """Return values after a first-order lag minus values before it, shape (n,); the initial state is steady.

    Args:
        constant: in `time`'s unit.
    """
    # The result is exact for linear interpolation [triangle-hold equivalent: Franklin, Powell and Workman, Digital
    # Control of Dynamic Systems, 3rd ed., sec. 6.3.2].
    steps = np.diff(time)
    fades = np.exp(-steps / constant)
    falls = np.diff(values) * (constant / steps) * -np.expm1(-steps / constant)
    recursion = np.vstack([np.ones(len(values)), np.append(-fades, 0.0)])
    return solve_banded((1, 0), recursion, np.append(0.0, -falls))
