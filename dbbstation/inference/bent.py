"""Effects shaped by a signal: saturation, dead zone, friction within a speed, scaled hysteresis, integral."""

from __future__ import annotations

from functools import partial
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.channel import Law
from dbbstation.inference.memory import starts_of
from dbbstation.inference.patterns import TRANSITS, Family, log_odds, odds_of_driven, play
from dbbstation.inference.variables import TRAVELS, Kind

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.variables import Variable

WIDTHS = {
    Family.SATURATION: tuple(np.geomspace(0.05, 3.0, 5).tolist()),
    Family.DEAD_ZONE: tuple(np.geomspace(0.01, 0.8, 5).tolist()),
}
"""Half widths that are tried at first, over the largest value: from what is nearly a step to what is nearly a straight line."""

SPEEDS = tuple(np.geomspace(0.01, 0.5, 5).tolist())
"""Speeds within which friction turns over, over the largest: within a smaller one it turns at once, and is hysteresis."""

BENT = 0.1
"""Probability that an effect that follows a variable, or its direction, departs from a straight line, or a sign, in one of these ways so far
that it is seen: as that of coming late enough."""


def bent_laws(
    variables: Sequence[Variable],
    time: NDArray[np.float64] | None,
    time_unit: str,
    blocks: Sequence[slice],
    size: float,
    unit: str,
) -> list[Law]:
    """Return saturation and dead zone of each variable; over time also friction, integral and scaled hysteresis."""
    usable = [v for v in variables if v.kind is not Kind.TIME and v.extent > 0.0]
    found = []
    for family, column in ((Family.SATURATION, _saturation), (Family.DEAD_ZONE, _dead_zone)):
        found += [
            _with_width(family, v, partial(column, v), WIDTHS[family], _largest(v), v.unit, size, unit, len(usable))
            for v in usable
        ]
    if time is None or any(np.any(np.diff(time[rows]) <= 0.0) for rows in blocks):
        return found
    paths = [v for v in usable if v.is_path(blocks)]
    turning = [v for v in paths if v.kind in TRAVELS and np.ptp(v.directions(blocks)) > 0.0]
    rate = {v.name: v.rates(time, blocks) for v in turning}
    found += [
        _with_width(
            Family.FRICTION, v, partial(_friction, rate[v.name]), SPEEDS, float(np.abs(rate[v.name]).max()),
            f"{v.unit or v.name}/{time_unit}", size, unit, len(turning),
        )
        for v in turning
    ]  # fmt: skip
    found += [_integral(v, time, time_unit, blocks, size, unit, len(usable)) for v in usable]
    pairs = [(a, b) for a, b in permutations(usable, 2) if a in turning and b.kind in SCALES_WITH]
    return found + [_scaled(a, b, blocks, size, unit, len(pairs)) for a, b in pairs]


def _largest(variable: Variable) -> float:
    return float(np.abs(_about(variable)).max())


def _about(variable: Variable) -> NDArray[np.float64]:
    """Return values about zero if they have both signs, else about the middle of their range."""
    middle = 0.0 if variable.low < 0.0 < variable.high else 0.5 * (variable.low + variable.high)
    return variable.values - middle


def _saturation(variable: Variable, point: tuple[float, ...]) -> NDArray[np.float64]:
    return np.tanh(_about(variable) / point[0])[:, None]


def _dead_zone(variable: Variable, point: tuple[float, ...]) -> NDArray[np.float64]:
    values = _about(variable)
    return (values - np.clip(values, -point[0], point[0]))[:, None]


def _friction(rate: NDArray[np.float64], point: tuple[float, ...]) -> NDArray[np.float64]:
    return np.tanh(rate / point[0])[:, None]


SCALES_WITH = frozenset({Kind.FORCE, Kind.SPEED, Kind.ANY})
"""Kinds that a force may be in proportion to: a load, a current or a speed has a zero of its own, a place or a temperature has none."""

_NUMBERS = {
    Family.SATURATION: ("limit", "turns over within"),
    Family.DEAD_ZONE: ("slope beyond", "half width"),
    Family.FRICTION: ("size", "turns over within"),
}


def _with_width(
    family: Family,
    variable: Variable,
    columns: Callable[[tuple[float, ...]], NDArray[np.float64]],
    shares: Sequence[float],
    largest: float,
    width_unit: str,
    size: float,
    unit: str,
    members: int,
) -> Law:
    """Return a law with one amplitude and one width, tried at shares of the largest value."""
    slope = family is Family.DEAD_ZONE
    return Law(
        name=f"{family} of {variable.name}",
        columns=columns,
        plausible=np.array([size]),
        parameters=_NUMBERS[family],
        units=(f"{unit}/{variable.unit}" if slope and variable.unit else unit, width_unit),
        grids=(tuple(share * largest for share in shares),),
        log_odds=log_odds(members) + float(np.log(0.5 * BENT)) + odds_of_driven([variable]),
        reach=size,
        family=family,
        variables=(variable,),
    )


def integral_of(variable: Variable, time: NDArray[np.float64], blocks: Sequence[slice]) -> NDArray[np.float64]:
    """Return a variable's integral about its mean by trapezoids, zero at each block's first row, shape (n,)."""
    found = np.zeros(len(time))
    for rows in blocks:
        own = variable.travel(rows) - float(np.mean(variable.values))
        found[rows] = np.concatenate([[0.0], np.cumsum(0.5 * (own[1:] + own[:-1]) * np.diff(time[rows]))])
    return found


def _integral(
    variable: Variable,
    time: NDArray[np.float64],
    time_unit: str,
    blocks: Sequence[slice],
    size: float,
    unit: str,
    members: int,
) -> Law:
    """Return a law for what accumulates, such as mass or heat, with each run's initial value."""
    starts = starts_of(blocks) if len(blocks) > 1 else 0
    samples = np.zeros((len(time), 1 + starts))
    samples[:, 0] = integral_of(variable, time, blocks)
    for k, rows in enumerate(blocks if starts else ()):
        samples[rows, 1 + (k if starts > 1 else 0)] = 1.0
    return Law(
        name=f"{Family.INTEGRAL} of {variable.name}",
        columns=lambda _point: samples,
        plausible=np.full(1 + starts, size),
        parameters=("rate", *(f"start {k + 1}" for k in range(starts))),
        units=(f"{unit}/({variable.unit or variable.name} {time_unit})", *[unit] * starts),
        log_odds=log_odds(members) + float(np.log(0.5 * BENT)) + odds_of_driven([variable]),
        reach=size,
        family=Family.INTEGRAL,
        variables=(variable,),
    )


def _scaled(one: Variable, by: Variable, blocks: Sequence[slice], size: float, unit: str, members: int) -> Law:
    """Return friction or play whose force is proportional to another variable, at once or over a distance."""
    turned = [one.directions(blocks), *(play(one.values, blocks, share * one.extent) for share in TRANSITS[:-1])]
    labels = ("at once", *(f"over {share * one.extent:.3g} {one.unit}".strip() for share in TRANSITS[:-1]))
    samples = np.column_stack(turned) * by.values[:, None]
    weight = -float(np.log(len(labels)))
    return Law(
        name=f"{Family.SCALED} of {one.name} by {by.name}",
        columns=lambda _point: samples,
        plausible=np.full(len(labels), size),
        parameters=("size per unit",) * len(labels),
        units=(f"{unit}/{by.unit}" if by.unit else unit,) * len(labels),
        log_odds=log_odds(members) + float(np.log(0.5 * BENT)) + odds_of_driven([one, by]),
        choices=tuple(((k,), weight, label) for k, label in enumerate(labels)),
        reach=size,
        family=Family.SCALED,
        variables=(one, by),
    )
