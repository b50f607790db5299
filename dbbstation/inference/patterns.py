"""Patterns: effects without physics over the variables of a channel, and how probable each kind is beforehand.

Some are forms with a name that people know: linear, once and twice per turn, hysteresis, a product of two variables, drift.
Others are any smooth curve, over all rows or by direction of travel. Waves, bumps, steps and pulses are looked for in what a
fit leaves; see `looks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.curves import Power, Spline
from dbbstation.inference.forms import Form, Sign, Wave
from dbbstation.inference.variables import TRAVELS, Kind, rates_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.variables import Variable

FAMILY_ODDS = float(np.log(0.1 / 0.9))
"""Log prior odds that a kind of effect without physics is there: one recording in ten. All variables of a kind share them, and so
do the frequencies or places that a wave, a bump, a step or a pulse was picked from."""

CURVES = 7
"""Functions of a smooth curve: it bends about five times over its range."""

DISTINCT = 5
"""Different values that a variable needs for a curve over it."""

WAVE_SHARE = 0.15
"""Share of a turn that an angle must cover for a wave of one turn to differ from a straight line by more than a hundredth."""

CONTINUOUS = 0.1
"""Share of its range that a variable that is sampled along a path changes from one row to the next, at the most, half of the time;
one that jumps from pose to pose has no speed."""


class Family(StrEnum):
    """Kinds of effects without physics."""

    LINEAR = "linear"
    ONCE = "once per turn"
    TWICE = "twice per turn"
    HYSTERESIS = "hysteresis"
    SPEED = "speed"
    LAG = "lag"
    DRIFT = "drift"
    PRODUCT = "product"
    CURVE = "curve"
    BY_DIRECTION = "curve by direction"
    WAVE = "wave"
    BUMP = "bump"
    STEP = "step"
    PULSES = "pulses"
    BLOCKS = "offset by block"


NAMED = frozenset(
    {Family.LINEAR, Family.ONCE, Family.TWICE, Family.HYSTERESIS, Family.SPEED, Family.LAG, Family.DRIFT, Family.BLOCKS}
)
"""Those that a search tries in pairs: each may show only beside the other."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """One effect without physics.

    Attributes:
        family: its kind.
        variables: that it follows; none for blocks.
        samples: what each amplitude does, over all rows, shape (n, p), about one at the most.
        form: of its curve, over the first variable, or over the row number where it follows none; None for a product.
        units: what one of each amplitude is per what, shape (p,); empty texts are the channel's own unit.
        per: by what each amplitude is to be divided for that, shape (p,).
        label: what tells it from others of its family over the same variables.
        tried: how many independent forms it was picked from.
        choices: of one pattern with several sizes, how many of the columns each takes, each with its log probability.
    """

    family: Family
    variables: tuple[Variable, ...]
    samples: NDArray[np.float64]
    form: Form | None = None
    units: tuple[str, ...] = ()
    per: tuple[float, ...] = ()
    label: str = ""
    tried: float = 1.0
    choices: tuple[tuple[int, float], ...] = ()

    @property
    def name(self) -> str:
        """Unique name, such as `once per turn of q1`."""
        over = " and ".join(variable.name for variable in self.variables)
        text = f"{self.family}{_JOIN.get(self.family, ' over ')}{over}" if over else str(self.family)
        return f"{text}, {self.label}" if self.label else text


_JOIN = {
    Family.LINEAR: " in ",
    Family.ONCE: " of ",
    Family.TWICE: " of ",
    Family.HYSTERESIS: " of ",
    Family.SPEED: " of ",
    Family.LAG: " of ",
    Family.DRIFT: " with ",
    Family.PRODUCT: " of ",
}
"""Between a family and its variables."""


def patterns(
    variables: Sequence[Variable], blocks: Sequence[slice], time: NDArray[np.float64] | None, simulated: Variable | None
) -> list[Pattern]:
    """Patterns that need no look at the residual.

    Args:
        variables: of the channel.
        blocks: rows of each, in time order.
        time: of the rows, shape (n,); None where their order is unknown: then nothing has a direction or a speed.
        simulated: what the simulation says; None where it is not asked whether it is late.
    """
    usable = [v for v in variables if len(np.unique(v.values)) >= 2]  # noqa: PLR2004 - a constant has no effect
    found = [pattern for v in usable for pattern in _over(v)]
    if time is not None:
        for variable in usable:
            if variable.kind in TRAVELS:
                found += _by_direction(variable, blocks)
        paths = [v for v in usable if v.kind in TRAVELS and _is_path(v, blocks)]
        found += [_speed(v, time, blocks, Family.SPEED) for v in paths]
        if simulated is not None and _is_path(simulated, blocks):
            found.append(_speed(simulated, time, blocks, Family.LAG))
    found += [_product(a, b) for a, b in combinations(usable, 2) if Kind.TIME not in (a.kind, b.kind)]
    if len(blocks) > 1:
        found.append(_of_blocks(blocks, len(usable[0].values) if usable else max(b.stop for b in blocks)))
    return [pattern for pattern in found if np.ptp(pattern.samples, axis=0).max(initial=0.0) > 0.0]


def log_odds(members: int, tried: float = 1.0) -> float:
    """Log prior odds of one pattern among so many of its family, picked from so many forms."""
    return FAMILY_ODDS - float(np.log(max(members, 1) * max(tried, 1.0)))


def turn(variable: Variable, order: int) -> Wave:
    """Wave that closes `order` times per turn of an angle."""
    return Wave(order / (variable.period or variable.extent))


def covers_turns(variable: Variable) -> bool:
    """Whether it is an angle that covers enough of a turn to show a wave of one turn."""
    return variable.period is not None and variable.extent >= WAVE_SHARE * variable.period


def _over(variable: Variable) -> list[Pattern]:
    """Patterns over one variable whatever the order of the rows is."""
    unit = f"/{variable.unit}" if variable.unit else f" per unit of {variable.name}"
    straight = Power(variable.low, variable.high)
    family = Family.DRIFT if variable.kind is Kind.TIME else Family.LINEAR
    found = [Pattern(family, (variable,), straight.columns(variable.values), straight, (unit,), (variable.half_range,))]
    if covers_turns(variable):
        for order, name in ((1, Family.ONCE), (2, Family.TWICE)):
            wave = turn(variable, order)
            found.append(Pattern(name, (variable,), wave.columns(variable.values), wave, ("", ""), (1.0, 1.0)))
    if len(np.unique(variable.values)) >= DISTINCT:
        spline = Spline(variable.low, variable.high, CURVES)
        found.append(Pattern(Family.CURVE, (variable,), spline.columns(variable.values), spline))
    return found


def _by_direction(variable: Variable, blocks: Sequence[slice]) -> list[Pattern]:
    """Patterns that change sign with the direction of travel; none where it goes one way only."""
    sign = variable.directions(blocks)
    if not (sign > 0.0).any() or not (sign < 0.0).any():
        return []
    found = [Pattern(Family.HYSTERESIS, (variable,), sign[:, None], Sign(), ("",), (1.0,))]
    if len(np.unique(variable.values)) >= DISTINCT:
        spline = Spline(variable.low, variable.high, CURVES)
        found.append(Pattern(Family.BY_DIRECTION, (variable,), spline.columns(variable.values) * sign[:, None], spline))
    return found


def _is_path(variable: Variable, blocks: Sequence[slice]) -> bool:
    """Whether it moves on from row to row, as along a path, rather than from pose to pose."""
    steps = [np.abs(np.diff(variable.values[rows])) for rows in blocks]
    every = np.concatenate([np.zeros(0), *steps])
    return len(every) > 0 and float(np.median(every)) < CONTINUOUS * variable.extent


def _speed(variable: Variable, time: NDArray[np.float64], blocks: Sequence[slice], family: Family) -> Pattern:
    """In proportion to how fast it changes; of the simulated value this is what a lag does."""
    rate = rates_of(variable.values, time, blocks)
    size = float(np.abs(rate).max(initial=0.0))
    # What is late by T lags behind by T times its rate.
    unit = "s" if family is Family.LAG else f" per {variable.unit or variable.name}/s"
    return Pattern(family, (variable,), rate[:, None] / (size or 1.0), None, (unit,), (size or 1.0,))


def _product(one: Variable, other: Variable) -> Pattern:
    """Product of two variables; of angles, products of their cosines and sines: waves of their sum and difference."""
    a, b = (
        turn(v, 1).columns(v.values) if covers_turns(v) else Power(v.low, v.high).columns(v.values)
        for v in (one, other)
    )
    return Pattern(Family.PRODUCT, (one, other), (a[:, :, None] * b[:, None, :]).reshape(len(a), -1))


def _of_blocks(blocks: Sequence[slice], rows: int) -> Pattern:
    samples = np.zeros((rows, len(blocks)))
    for k, own in enumerate(blocks):
        samples[own, k] = 1.0
    return Pattern(Family.BLOCKS, (), samples)
