"""Effects of a signal with memory, such as a lag or dead time, and nonlinear effects, such as saturation."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import TRAVELS, Kind, Law
from dbbstation.inference.patterns import DISTINCT, TRANSITS, Family, log_odds, odds_of_driven, one_of
from dbbstation.laws.memory import lagging
from dbbstation.laws.play import within
from dbbstation.laws.time_skew import delayed

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.channel import Variable
    from dbbstation.inference.patterns import Choices


DEPARTS = 0.1
"""Prior probability of a visible delay of either kind; also of a visible departure from a straight line or a sign in one
of the other ways. Over a slow variable any delay is invisible, and the effect is called linear."""

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
        (Family.MEMORY, "time constant", _lag, _grid(BOUNDS.memory_rows * row, BOUNDS.memory_share * longest)),
        (Family.DEAD_TIME, "dead time", _delay, _grid(row, BOUNDS.delay_share * longest)),
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
                    log_odds=log_odds(len(usable)) + float(np.log(DEPARTS / len(kinds))) + odds_of_driven([variable]),
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
        behind = delayed(values, at, point[0])
        found[rows] = np.column_stack([values - _middle(variable) + behind, behind])
    return found


def _middle(variable: Variable) -> float:
    return 0.5 * (variable.low + variable.high)


WIDTHS = {
    Family.SATURATION: tuple(np.geomspace(0.02, 3.0, 6).tolist()),
    Family.DEAD_ZONE: tuple(np.geomspace(0.01, 0.8, 5).tolist()),
}
"""First tried half-widths over the largest value, from nearly a step to nearly a straight line."""

WIDEST = 0.95
"""Largest half-width of a sharp bend, over the largest value: no rows are beyond."""

KNEES = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
"""First tried places of a knee, in shares of the range."""

SPEEDS = tuple(np.geomspace(0.01, 0.5, 5).tolist())
"""Tried transition speeds of friction, over the largest speed; with smaller ones friction is hysteresis."""

MADE = 0.9
"""Share of the simulated value's squares that a linear model must explain before its slopes give directions of growth."""


def bent_laws(
    variables: Sequence[Variable],
    time: Floats | None,
    time_unit: str,
    blocks: Sequence[slice],
    size: float,
    unit: str,
    grows: Mapping[str, float] | None = None,
) -> list[Law]:
    """Return saturation, dead zone and knees for each variable; with time also friction, integral and scaled hysteresis.

    Args:
        grows: result of `grows_with`, which distinguishes a limit from a dead zone.
    """
    usable = [v for v in variables if v.kind is not Kind.TIME and v.extent > 0.0]
    bending = [v for v in usable if v.distinct >= DISTINCT]
    found = [
        _bend(family, v, (grows or {}).get(v.name, 0.0), size, unit, len(bending))
        for family in (Family.SATURATION, Family.DEAD_ZONE)
        for v in bending
    ]
    found += [_knee(side, v, size, unit, 2 * len(bending)) for side in ("upper", "lower") for v in bending]
    if time is None or any(np.any(np.diff(time[rows]) <= 0.0) for rows in blocks):
        return found
    paths = [v for v in usable if v.is_path(blocks)]
    turning = [v for v in paths if v.kind in TRAVELS and (v.range or np.ptp(v.directions(blocks)) > 0.0)]
    rate = {v.name: v.rates(time, blocks) for v in turning}
    found += [
        _with_width(
            f"{Family.FRICTION} of {v.name}", Family.FRICTION, v, partial(_friction, rate[v.name]),
            tuple(share * float(np.abs(rate[v.name]).max()) for share in SPEEDS),
            (("size", unit, ""),), ("turns over within", f"{v.unit or v.name}/{time_unit}"), size, len(turning),
        )
        for v in turning
    ]  # fmt: skip
    found += [_integral(v, time, time_unit, blocks, size, unit, len(usable)) for v in usable]
    pairs = [(a, b) for a, b in permutations(usable, 2) if a in turning and b.kind in SCALES_WITH]
    return found + [_scaled(a, b, blocks, size, unit, len(pairs)) for a, b in pairs]


def grows_with(variables: Sequence[Variable], simulated: Floats, size: float) -> dict[str, float]:
    """Return whether the simulated value rises (1) or falls (-1) with each variable; 0 if neither or unknown."""
    variables = [v for v in variables if v.kind is not Kind.TIME and v.distinct >= DISTINCT]
    found = dict.fromkeys((v.name for v in variables), 0.0)
    if not variables or np.ptp(simulated) == 0.0:
        return found
    own = simulated - simulated.mean()
    same = [v for v in variables if is_same(v.values, simulated)]
    for v in same:
        found[v.name] = float(np.sign(np.corrcoef(v.values, simulated)[0, 1]))
    if same:
        return found
    columns = np.column_stack([(v.values - v.values.mean()) / np.std(v.values) for v in variables])
    slopes = np.linalg.lstsq(columns, own, rcond=None)[0]
    left = float(np.std(own - columns @ slopes))
    # A limited or missing effect is at most as large as the simulated effect.
    if left**2 <= (1.0 - MADE) * float(np.var(own)):
        for v, slope in zip(variables, slopes.tolist(), strict=True):
            found[v.name] = float(np.sign(slope)) if abs(slope) > max(left, 0.5 * size) else 0.0
    return found


SAME = 1e-6
"""A variable with 1 - correlation below this is the simulated value itself."""


def is_same(one: Floats, other: Floats) -> bool:
    """Return whether columns are equal but for scale and origin, within a thousandth."""
    return abs(float(np.corrcoef(one, other)[0, 1])) > 1.0 - SAME


def _bend(family: Family, variable: Variable, grows: float, size: float, unit: str, members: int) -> Law:
    """Return saturation or dead zone, according to the simulated value's growth with a variable."""
    # A limit and a dead zone of one width add up to a straight line. If the simulation contains this line, an object
    # with a limit lacks the part beyond the width, and an object with a dead zone lacks the part within. The sign
    # decides.
    # Centred at zero if it has both signs, else at mid-range.
    middle = 0.0 if variable.low < 0.0 < variable.high else 0.5 * (variable.low + variable.high)
    values, largest = variable.values - middle, max(variable.high - middle, middle - variable.low)
    slope = f"{unit}/{variable.unit}" if variable.unit else unit

    def columns(point: tuple[float, ...]) -> Floats:
        width = min(point[0], WIDEST * largest)
        within = np.clip(values, -width, width)
        if family is Family.DEAD_ZONE:
            return np.column_stack([values - within, -within] if grows else [values - within]) * (grows or 1.0)
        smooth = np.tanh(values / point[0])
        limits = [smooth, within / width]
        return np.column_stack([*limits, within - values, point[0] * smooth - values] if grows else limits) * (
            grows or 1.0
        )

    names = (
        (
            ("slope beyond", slope, "which the simulation lacks"),
            ("slope within", slope, "which the simulation has straight"),
        )
        if family is Family.DEAD_ZONE
        else (
            ("limit", unit, "rounded"),
            ("limit", unit, "sharp"),
            ("slope", slope, "sharp, which the simulation has straight"),
            ("slope", slope, "rounded, which the simulation has straight"),
        )
    )
    own = names if grows else names[: 1 if family is Family.DEAD_ZONE else 2]
    width = ("half width" if family is Family.DEAD_ZONE else "turns over within", variable.unit)
    grid = tuple(share * largest for share in WIDTHS[family])
    law = _with_width(f"{family} of {variable.name}", family, variable, columns, grid, own, width, size, members)
    return replace(law, positive=(True,)) if grows else law


def _knee(side: str, variable: Variable, size: float, unit: str, members: int) -> Law:
    def columns(point: tuple[float, ...]) -> Floats:
        beyond = variable.values - point[0]
        return (np.maximum(beyond, 0.0) if side == "upper" else np.minimum(beyond, 0.0))[:, None]

    slope = f"{unit}/{variable.unit}" if variable.unit else unit
    grid = tuple(variable.low + share * variable.extent for share in KNEES)
    return _with_width(
        f"{side} {Family.KNEE} of {variable.name}", Family.KNEE, variable, columns, grid, (("slope beyond", slope, ""),),
        ("knee", variable.unit), size, members,
    )  # fmt: skip


def _friction(rate: Floats, point: tuple[float, ...]) -> Floats:
    return np.tanh(rate / point[0])[:, None]


def _with_width(
    name: str,
    family: Family,
    variable: Variable,
    columns: Callable[[tuple[float, ...]], Floats],
    grid: tuple[float, ...],
    amplitudes: Sequence[tuple[str, str, str]],
    width: tuple[str, str],
    size: float,
    members: int,
) -> Law:
    choices = one_of([label for _, _, label in amplitudes])
    return Law(
        name=name,
        columns=columns,
        plausible=np.full(len(amplitudes), size),
        parameters=(*(one for one, _, _ in amplitudes), width[0]),
        units=(*(unit for _, unit, _ in amplitudes), width[1]),
        grids=(grid,),
        log_odds=_log_odds(members, variable),
        choices=choices if len(choices) > 1 else (),
        reach=size,
        family=family,
        variables=(variable,),
    )


SCALES_WITH = frozenset({Kind.FORCE, Kind.SPEED, Kind.ANY})
"""Kinds of variables to which a force may be proportional: load, current and speed have a natural zero, place and temperature do not."""


def integral_of(values: Floats, time: Floats, blocks: Sequence[slice]) -> Floats:
    """Return the integral by the trapezoidal rule, zero at each block's first row, shape (n,)."""
    found = np.zeros(len(time))
    for rows in blocks:
        own = values[rows]
        found[rows] = np.concatenate([[0.0], np.cumsum(0.5 * (own[1:] + own[:-1]) * np.diff(time[rows]))])
    return found


def _integral(
    variable: Variable,
    time: Floats,
    time_unit: str,
    blocks: Sequence[slice],
    size: float,
    unit: str,
    members: int,
) -> Law:
    """Return a law for accumulating quantities, such as mass or heat, with each run's initial value."""
    # The balanced value of a signal is seldom zero (outflow, bias, room temperature), so the law includes a linear
    # drift.
    starts = starts_of(blocks) if len(blocks) > 1 else 0
    middle = 0.5 * (variable.low + variable.high)
    travel = np.concatenate([variable.travel(rows) for rows in blocks])
    samples = np.zeros((len(time), 2 + starts))
    samples[:, 0] = integral_of(travel - middle, time, blocks)
    samples[:, 1] = integral_of(np.ones(len(time)), time, blocks)
    for k, rows in enumerate(blocks if starts else ()):
        samples[rows, 2 + (k if starts > 1 else 0)] = 1.0
    return Law(
        name=f"{Family.INTEGRAL} of {variable.name}",
        columns=lambda _point: samples,
        plausible=np.full(2 + starts, size),
        parameters=("rate", "drift", *(f"start {k + 1}" for k in range(starts))),
        units=(f"{unit}/({variable.unit or variable.name} {time_unit})", f"{unit}/{time_unit}", *[unit] * starts),
        log_odds=_log_odds(members, variable),
        zero_from=middle,
        reach=size,
        family=Family.INTEGRAL,
        variables=(variable,),
    )


def _log_odds(members: int, *over: Variable) -> float:
    return log_odds(members) + float(np.log(0.5 * DEPARTS)) + odds_of_driven(over)


def _scaled(one: Variable, by: Variable, blocks: Sequence[slice], size: float, unit: str, members: int) -> Law:
    turned = [one.directions(blocks), *(within(one.values, blocks, share * one.extent) for share in TRANSITS[:-1])]
    labels = ("at once", *(f"over {share * one.extent:.3g} {one.unit}".strip() for share in TRANSITS[:-1]))
    samples = np.column_stack(turned) * by.values[:, None]
    return Law(
        name=f"{Family.SCALED} of {one.name} by {by.name}",
        columns=lambda _point: samples,
        plausible=np.full(len(labels), size),
        parameters=("size per unit",) * len(labels),
        units=(f"{unit}/{by.unit}" if by.unit else unit,) * len(labels),
        log_odds=_log_odds(members, one, by),
        choices=one_of(labels),
        reach=size,
        family=Family.SCALED,
        variables=(one, by),
    )
