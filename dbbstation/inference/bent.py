"""Effects of a signal with memory, such as a lag or dead time, and nonlinear effects, such as saturation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import permutations
from typing import TYPE_CHECKING, Any

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


@dataclass(frozen=True, eq=False)
class LawRows:
    """Rows of the laws, in time order within blocks.

    Attributes:
        time: shape (n,); None for unordered rows.
        size: prior standard deviation of an effect.
    """

    time: Floats | None
    time_unit: str
    blocks: Sequence[slice]
    size: float
    unit: str

    def per(self, variable: Variable) -> str:
        """Return the unit of a slope over a variable."""
        return f"{self.unit}/{variable.unit}" if variable.unit else self.unit

    def law(
        self,
        family: Family,
        over: tuple[Variable, ...],
        columns: Callable[[tuple[float, ...]], Floats],
        amplitudes: Sequence[tuple[str, str]],
        members: int,
        *shapes: tuple[str, str, tuple[float, ...]],
        side: str = "",
        plausible: Floats | None = None,
        **further: Any,  # noqa: ANN401 - other fields
    ) -> Law:
        """Return a law over variables.

        Args:
            amplitudes: names and units.
            members: number of laws that share the family's odds.
            shapes: names, units and starting values of nonlinear parameters.
        """
        return Law(
            name=f"{side}{family} of {' by '.join(v.name for v in over)}",
            columns=columns,
            plausible=np.full(len(amplitudes), self.size) if plausible is None else plausible,
            parameters=(*(name for name, _ in amplitudes), *(name for name, _, _ in shapes)),
            units=(*(unit for _, unit in amplitudes), *(unit for _, unit, _ in shapes)),
            grids=tuple(grid for _, _, grid in shapes),
            log_odds=log_odds(members) + float(np.log(0.5 * DEPARTS)) + odds_of_driven(over),
            reach=self.size,
            family=family,
            variables=over,
            **further,
        )

    def starts(self, count: int) -> list[tuple[str, str]]:
        """Return the amplitudes of initial states."""
        return [(f"start {k + 1}", self.unit) for k in range(count)]


def memory_laws(table: LawRows, variables: Sequence[Variable]) -> list[Law]:
    """Return laws with lag and dead time for each path variable."""
    time, blocks, size = table.time, table.blocks, table.size
    if time is None:
        return []
    usable = [v for v in variables if v.kind is not Kind.TIME and v.extent > 0.0 and v.is_path(blocks)]
    moving = [rows for rows in blocks if rows.stop - rows.start > 1]
    steps = [np.diff(time[rows]) for rows in moving]
    if not usable or min((float(step.min()) for step in steps), default=0.0) <= 0.0:
        return []
    row = float(np.median(np.concatenate(steps)))
    longest = max(float(np.sum(step)) for step in steps)
    kinds = (
        (Family.MEMORY, "time constant", lagging, _grid(BOUNDS.memory_rows * row, BOUNDS.memory_share * longest)),
        (Family.DEAD_TIME, "dead time", delayed, _grid(row, BOUNDS.delay_share * longest)),
    )
    found = []
    for family, parameter, late, grid in kinds:
        for variable in usable if grid else ():
            starts = starts_of(blocks) if family is Family.MEMORY else 0
            found.append(
                table.law(
                    family,
                    (variable,),
                    partial(_late, variable, time, blocks, starts, late),
                    [("gain", table.per(variable))] * 2 + table.starts(starts),
                    len(usable),
                    (parameter, table.time_unit, grid),
                    plausible=np.array([size / variable.half_range] * 2 + [size] * starts),
                    choices=_choices(2 + starts),
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


def _late(
    variable: Variable,
    time: Floats,
    blocks: Sequence[slice],
    starts: int,
    late: Callable[[Floats, Floats, float], Floats],
    point: tuple[float, ...],
) -> Floats:
    """Return delayed values, delayed less present values, and initial transients, shape (n, 2 + starts).

    Args:
        late: function from values, their times and the delay to delayed less present values.
    """
    found = np.zeros((len(time), 2 + starts))
    for k, rows in enumerate(blocks):
        values, at = variable.travel(rows), time[rows]
        found[rows, 1] = late(values, at, point[0])
        found[rows, 0] = values - _middle(variable) + found[rows, 1]
        if starts:
            found[rows, 2 + (k if starts > 1 else 0)] = np.exp(-(at - at[0]) / point[0])
    return found


def starts_of(blocks: Sequence[slice]) -> int:
    """Return the number of a law's initial states: one per run, or one in all if there are many runs."""
    return len(blocks) if len(blocks) <= BOUNDS.memory_starts else 1


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


def bent_laws(table: LawRows, variables: Sequence[Variable], grows: Mapping[str, float]) -> list[Law]:
    """Return saturation, dead zone and knees for each variable; with time also friction, integral and scaled hysteresis.

    Args:
        grows: result of `grows_with`, which distinguishes a limit from a dead zone.
    """
    time, blocks = table.time, table.blocks
    usable = [v for v in variables if v.kind is not Kind.TIME and v.extent > 0.0]
    bending = [v for v in usable if v.distinct >= DISTINCT]
    found = [
        _bend(table, family, v, grows.get(v.name, 0.0), len(bending))
        for family in (Family.SATURATION, Family.DEAD_ZONE)
        for v in bending
    ]
    found += [_knee(table, side, v, 2 * len(bending)) for side in ("upper", "lower") for v in bending]
    if time is None or any(np.any(np.diff(time[rows]) <= 0.0) for rows in blocks):
        return found
    paths = [v for v in usable if v.is_path(blocks)]
    turning = [v for v in paths if v.kind in TRAVELS and (v.range or np.ptp(v.directions(blocks)) > 0.0)]
    found += [_friction(table, time, v, len(turning)) for v in turning]
    found += [_integral(table, time, v, len(usable)) for v in usable]
    pairs = [(a, b) for a, b in permutations(usable, 2) if a in turning and b.kind in SCALES_WITH]
    return found + [_scaled(table, a, b, len(pairs)) for a, b in pairs]


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


def _bend(table: LawRows, family: Family, variable: Variable, grows: float, members: int) -> Law:
    """Return saturation or dead zone, according to the simulated value's growth with a variable."""
    # A limit and a dead zone of one width add up to a straight line. If the simulation contains this line, an object
    # with a limit lacks the part beyond the width, and an object with a dead zone lacks the part within. The sign
    # decides.
    # Centred at zero if it has both signs, else at mid-range.
    middle = 0.0 if variable.low < 0.0 < variable.high else _middle(variable)
    values, largest = variable.values - middle, max(variable.high - middle, middle - variable.low)
    unit, slope, dead = table.unit, table.per(variable), family is Family.DEAD_ZONE

    def columns(point: tuple[float, ...]) -> Floats:
        width = min(point[0], WIDEST * largest)
        within = np.clip(values, -width, width)
        if dead:
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
        if dead
        else (
            ("limit", unit, "rounded"),
            ("limit", unit, "sharp"),
            ("slope", slope, "sharp, which the simulation has straight"),
            ("slope", slope, "rounded, which the simulation has straight"),
        )
    )
    own = names if grows else names[: 1 if dead else 2]
    width = "half width" if dead else "turns over within"
    return table.law(
        family,
        (variable,),
        columns,
        [(name, per) for name, per, _ in own],
        members,
        (width, variable.unit, tuple(share * largest for share in WIDTHS[family])),
        choices=one_of([label for _, _, label in own]) if len(own) > 1 else (),
        positive=(True,) * len(own) if grows else (),
    )


def _knee(table: LawRows, side: str, variable: Variable, members: int) -> Law:
    def columns(point: tuple[float, ...]) -> Floats:
        beyond = variable.values - point[0]
        return (np.maximum(beyond, 0.0) if side == "upper" else np.minimum(beyond, 0.0))[:, None]

    shape = "knee", variable.unit, tuple(variable.low + share * variable.extent for share in KNEES)
    slope = [("slope beyond", table.per(variable))]
    return table.law(Family.KNEE, (variable,), columns, slope, members, shape, side=f"{side} ")


def _friction(table: LawRows, time: Floats, variable: Variable, members: int) -> Law:
    rate = variable.rates(time, table.blocks)
    grid = tuple(share * float(np.abs(rate).max()) for share in SPEEDS)
    shape = "turns over within", f"{variable.unit or variable.name}/{table.time_unit}", grid
    size = [("size", table.unit)]
    return table.law(
        Family.FRICTION, (variable,), lambda point: np.tanh(rate / point[0])[:, None], size, members, shape
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


def _integral(table: LawRows, time: Floats, variable: Variable, members: int) -> Law:
    """Return a law for accumulating quantities, such as mass or heat, with each run's initial value."""
    # The balanced value of a signal is seldom zero (outflow, bias, room temperature), so the law includes a linear
    # drift.
    blocks = table.blocks
    starts = starts_of(blocks) if len(blocks) > 1 else 0
    middle = _middle(variable)
    travel = np.concatenate([variable.travel(rows) for rows in blocks])
    samples = np.zeros((len(time), 2 + starts))
    samples[:, 0] = integral_of(travel - middle, time, blocks)
    samples[:, 1] = integral_of(np.ones(len(time)), time, blocks)
    for k, rows in enumerate(blocks if starts else ()):
        samples[rows, 2 + (k if starts > 1 else 0)] = 1.0
    rate = f"{table.unit}/({variable.unit or variable.name} {table.time_unit})"
    amplitudes = [("rate", rate), ("drift", f"{table.unit}/{table.time_unit}"), *table.starts(starts)]
    return table.law(Family.INTEGRAL, (variable,), lambda _: samples, amplitudes, members, zero_from=middle)


def _scaled(table: LawRows, one: Variable, by: Variable, members: int) -> Law:
    turned = [one.directions(table.blocks)]
    turned += [within(one.values, table.blocks, share * one.extent) for share in TRANSITS[:-1]]
    labels = ("at once", *(f"over {share * one.extent:.3g} {one.unit}".strip() for share in TRANSITS[:-1]))
    samples = np.column_stack(turned) * by.values[:, None]
    sizes = [("size per unit", table.per(by))] * len(labels)
    return table.law(Family.SCALED, (one, by), lambda _: samples, sizes, members, choices=one_of(labels))
