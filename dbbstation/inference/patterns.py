"""Patterns: effects over variables without known physics, with prior odds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations, product
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dbbstation.inference.channel import TRAVELS, Kind
from dbbstation.inference.forms import Form, Proportional, SignForm, Spline, Walk, Wave
from dbbstation.inference.triangle import products_of_rows
from dbbstation.laws.play import within

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.channel import Variable

FAMILY_ODDS = float(np.log(0.1 / 0.9))
"""Log prior odds of a family of patterns, present in one recording of ten. All variables share them, and so do all
searched frequencies or places."""

CURVES = 7
"""Functions of a smooth curve, which has about five bends."""

DISTINCT = 5
"""Fewest different values of a variable for a curve."""

WAVE_SHARE = 0.15
"""Least share of a turn that an angle must cover; with less, a wave once per turn is a straight line to one hundredth."""


Choices: TypeAlias = "tuple[tuple[tuple[int, ...], float, str], ...]"
"""Forms of an effect: places of their amplitudes, log probability, label."""


def one_of(labels: Sequence[str], width: int = 1) -> Choices:
    """Return equally probable forms, of `width` amplitudes each."""
    weight = -float(np.log(len(labels)))
    return tuple((tuple(range(k * width, (k + 1) * width)), weight, label) for k, label in enumerate(labels))


class Family(StrEnum):
    """Kinds of effects without physics."""

    LINEAR = "linear"
    ONCE = "once per turn"
    TWICE = "twice per turn"
    HYSTERESIS = "hysteresis"
    SPEED = "speed"
    DRAG = "drag"
    LAG = "lag"
    MEMORY = "memory"
    DEAD_TIME = "dead time"
    INTEGRAL = "integral"
    SATURATION = "saturation"
    DEAD_ZONE = "dead zone"
    KNEE = "knee"
    FRICTION = "friction"
    SCALED = "scaled hysteresis"
    DRIFT = "drift"
    WANDER = "wander"
    PRODUCT = "product"
    CURVE = "curve"
    BY_DIRECTION = "curve by direction"
    WAVE = "wave"
    BUMP = "bump"
    STEP = "step"
    PULSES = "pulses"
    PULSES_BY_DIRECTION = "pulses by direction"
    BLOCKS = "offset by block"


NAMED = frozenset(
    {
        Family.LINEAR,
        Family.ONCE,
        Family.TWICE,
        Family.HYSTERESIS,
        Family.SPEED,
        Family.DRAG,
        Family.LAG,
        Family.DRIFT,
        Family.PRODUCT,
        Family.BLOCKS,
    }
)
"""Families tried in pairs, because each may hide the other."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """One effect without known physics.

    Attributes:
        samples: effects of unit amplitudes, all rows, shape (n, p), at most about one.
        form: curve over the first variable or row number; None for a product.
        units: of amplitudes, shape (p,); empty for the channel's.
        per: divisors that convert to these units, shape (p,).
        tried: number of independent forms from which it was picked.
        choices: alternative forms: columns, log probability, label.
        slack: columns that move the zeros of every form's factors; see `ZERO_SD`.
        acts_once: whether it is a single event that other rows cannot show.
    """

    family: Family
    variables: tuple[Variable, ...]
    samples: Floats
    form: Form | None = None
    units: tuple[str, ...] = ()
    per: tuple[float, ...] = ()
    label: str = ""
    tried: float = 1.0
    choices: Choices = ()
    slack: tuple[int, ...] = ()
    acts_once: bool = False

    @classmethod
    def plain(
        cls,
        family: Family,
        variables: tuple[Variable, ...],
        samples: Floats,
        form: Form,
        label: str = "",
        tried: float = 1.0,
        choices: Choices = (),
    ) -> Pattern:
        """Return a pattern with amplitudes in the channel's unit."""
        width = samples.shape[1]
        return cls(family, variables, samples, form, ("",) * width, (1.0,) * width, label, tried, choices)

    @property
    def name(self) -> str:
        """Return a unique name, such as `once per turn of q1`."""
        over = " and ".join(variable.name for variable in self.variables)
        text = f"{self.family}{_JOIN.get(self.family, ' over ')}{over}" if over else str(self.family)
        return f"{text}, {self.label}" if self.label else text


_JOIN = {
    **dict.fromkeys(
        (Family.ONCE, Family.TWICE, Family.HYSTERESIS, Family.SPEED, Family.DRAG, Family.LAG, Family.PRODUCT), " of "
    ),
    Family.LINEAR: " in ",
    Family.DRIFT: " with ",
}
"""Words between a family and its variables."""


def patterns(
    variables: Sequence[Variable],
    blocks: Sequence[slice],
    time: Floats | None,
    simulated: Variable | None,
    time_unit: str = "s",
) -> list[Pattern]:
    """Return patterns that need no search.

    Args:
        time: shape (n,); None for unordered rows without direction and speed.
        simulated: None for no test of delays.
    """
    usable = [v for v in variables if v.distinct >= 2]  # noqa: PLR2004 - a constant has no effect
    found = [pattern for v in usable for pattern in _over(v)]
    # A speed and the rate of its path would be two names of one drag.
    speeds = [(v, v.values, f"({v.unit})") for v in usable if v.kind is Kind.SPEED]
    if time is not None:
        for variable in usable:
            if variable.kind in TRAVELS:
                found += _by_direction(variable, blocks)
        late = simulated.name if simulated is not None else ""
        paths = [v for v in usable if v.kind in TRAVELS and v.name != late and v.is_path(blocks)]
        found += [_speed(v, time, blocks, f"/({v.unit or v.name}/{time_unit})") for v in paths]
        places = [v for v in paths if v.kind in {Kind.ANGLE, Kind.LENGTH}]
        speeds = speeds or [(v, v.rates(time, blocks), f"({v.unit}/{time_unit})") for v in places]
        if simulated is not None and simulated.is_path(blocks):
            # A delay T shifts a value by T times its rate.
            found.append(_speed(simulated, time, blocks, time_unit, Family.LAG))
    found += [_drag(v, rate, unit) for v, rate, unit in speeds]
    found += [_product(a, b) for a, b in combinations(usable, 2) if Kind.TIME not in (a.kind, b.kind)]
    if len(blocks) > 1:
        found.append(of_blocks(blocks, len(usable[0].values) if usable else max(b.stop for b in blocks)))
    others = any(v.range is not None for v in variables)
    return [pattern for pattern in found if others or np.ptp(pattern.samples, axis=0).max(initial=0.0) > 0.0]


DRIVEN_ODDS = -float(np.log(19.0))
"""Log prior odds against driven variables as causes: rows must prefer one by the odds of a sure answer. With odds of 4
and 99 the cause also ranked before its consequence in four of four tables."""


def odds_of_driven(variables: Iterable[Variable]) -> float:
    """Return the log prior odds for variables, lower for driven ones."""
    return DRIVEN_ODDS if any(variable.driven for variable in variables) else 0.0


def log_odds(members: int, tried: float = 1.0) -> float:
    """Return a pattern's log prior odds, from family size and number of trials."""
    return FAMILY_ODDS - float(np.log(max(members, 1) * max(tried, 1.0)))


def turn(variable: Variable, order: int) -> Wave:
    """Return a wave closing `order` times per turn."""
    return Wave(order / (variable.period or variable.extent))


def covers_turns(variable: Variable) -> bool:
    """Return whether an angle covers enough of a turn."""
    return variable.period is not None and variable.extent >= WAVE_SHARE * variable.period


def _over(variable: Variable) -> list[Pattern]:
    unit = f"/{variable.unit}" if variable.unit else f" per unit of {variable.name}"
    straight = Proportional(variable.half_range, 0.5 * (variable.low + variable.high))
    family = Family.DRIFT if variable.kind is Kind.TIME else Family.LINEAR
    found = [Pattern(family, (variable,), straight.columns(variable.values), straight, (unit,), (variable.half_range,))]
    if covers_turns(variable):
        for order, name in ((1, Family.ONCE), (2, Family.TWICE)):
            wave = turn(variable, order)
            found.append(Pattern.plain(name, (variable,), wave.columns(variable.values), wave))
    if variable.distinct >= DISTINCT:
        spline = Spline(variable.low, variable.high, CURVES)
        found.append(Pattern(Family.CURVE, (variable,), spline.columns(variable.values), spline))
    return found


def _by_direction(variable: Variable, blocks: Sequence[slice]) -> list[Pattern]:
    sign = variable.directions(blocks)
    if variable.range is None and not ((sign > 0.0).any() and (sign < 0.0).any()):
        return []
    found = [_hysteresis(variable, blocks, sign)]
    if variable.distinct >= DISTINCT:
        spline = Spline(variable.low, variable.high, CURVES)
        found.append(Pattern(Family.BY_DIRECTION, (variable,), spline.columns(variable.values) * sign[:, None], spline))
    return found


def _hysteresis(variable: Variable, blocks: Sequence[slice], sign: Floats) -> Pattern:
    widths = [share * variable.extent for share in TRANSITS]
    # A row at a turning point may belong to the old or the new direction.
    arriving = variable.arriving(blocks)
    leaving = np.concatenate([np.append(arriving[rows][1:], arriving[rows][-1:]) for rows in blocks])
    samples = np.column_stack([sign, arriving, leaving, *(within(variable.values, blocks, width) for width in widths)])
    labels = (
        "at once",
        "at once, a row later",
        "at once, a row earlier",
        *(f"over {width:.3g} {variable.unit}".strip() for width in widths),
    )
    return Pattern.plain(Family.HYSTERESIS, (variable,), samples, SignForm(), choices=one_of(labels))


TRANSITS = (0.003, 0.01, 0.03, 0.1)
"""Travels after a reversal over which hysteresis changes sides, in shares of the range."""


def _speed(
    variable: Variable, time: Floats, blocks: Sequence[slice], unit: str, family: Family = Family.SPEED
) -> Pattern:
    rate = variable.rates(time, blocks)
    size = float(np.abs(rate).max(initial=0.0)) or 1.0
    if family is Family.LAG:
        rate = -rate
    return Pattern(family, (variable,), rate[:, None] / size, None, (unit,), (size,))


def _drag(variable: Variable, rate: Floats, unit: str) -> Pattern:
    """Return the square of a speed, against it [Landau and Lifshitz, Fluid Mechanics, 2nd ed., sec. 45]."""
    size = float(np.abs(rate).max(initial=0.0)) or 1.0
    samples = rate * np.abs(rate) / size**2
    return Pattern(Family.DRAG, (variable,), samples[:, None], None, (f"/{unit}²",), (size**2,))


def _product(one: Variable, other: Variable) -> Pattern:
    """Return products of two variables about zeros within their ranges, with columns that move these zeros.

    (x - x0 - d) (y - y0 - e) is (x - x0) (y - y0) less d y and e x, up to a constant. Angles have waves once per turn
    instead of x, whose zeros are known.
    """
    # For angles, products of cosines and sines give waves of sum and difference.
    waves = [v for v in (one, other) if covers_turns(v)]
    lines = [v for v in (one, other) if not covers_turns(v)]
    if not lines:
        a, b = (turn(v, 1).columns(v.values) for v in waves)
        return Pattern(Family.PRODUCT, (one, other), products_of_rows(a, b))
    wave = turn(waves[0], 1).columns(waves[0].values) if waves else np.ones((len(one.values), 1))
    columns, labels = [], []
    for zeros in product(ZEROS, repeat=len(lines)):
        columns.append(wave * np.prod([v.scaled - z for v, z in zip(lines, zeros, strict=True)], axis=0)[:, None])
        labels.append(f"about {zeros_text(lines, zeros)}")
    moving = [wave] if waves else [one.scaled[:, None], other.scaled[:, None]]
    whole = wave.shape[1] * len(labels)
    slack = tuple(range(whole, whole + sum(part.shape[1] for part in moving)))
    first, second = (f"({v.unit})" if "/" in v.unit or " " in v.unit else v.unit or v.name for v in (one, other))
    unit = f"/{first}²" if first == second else f"/({first} {second})"
    units, per = ((unit,) * whole, (one.half_range * other.half_range,) * whole) if not waves else ((), ())
    samples = np.hstack([*columns, *moving])
    return Pattern(
        Family.PRODUCT, (one, other), samples, None, units, per, choices=one_of(labels, wave.shape[1]), slack=slack
    )


def zeros_text(lines: Sequence[Variable], zeros: Sequence[float]) -> str:
    """Return places in scaled units as text, such as `x 3 mm and y -1 mm`."""
    at = [0.5 * (v.low + v.high) + zero * v.half_range for v, zero in zip(lines, zeros, strict=True)]
    return " and ".join(f"{v.name} {place:.4g} {v.unit}".strip() for v, place in zip(lines, at, strict=True))


ZERO_SD = 1.0 / 3.0
"""Prior standard deviation of a zero about a tried one, half their distance, in half ranges of the factor."""

ZEROS = (-2.0 * ZERO_SD, 0.0, 2.0 * ZERO_SD)
"""Tried zeros of a factor: middles of thirds of its range. Farther zeros give nearly a straight line in the other
factor, a separate and more probable cause."""


def of_blocks(blocks: Sequence[slice], rows: int) -> Pattern:
    """Return an offset of each run."""
    samples = np.zeros((rows, len(blocks)))
    for k, own in enumerate(blocks):
        samples[own, k] = 1.0
    return Pattern(Family.BLOCKS, (), samples)


WALK_STEPS = 10
"""Linear pieces of a random walk. Noise with `FEWEST_INDEPENDENT` samples has a corner at six half periods over the rows,
above which it contains the walk. On eight walks 5 to 14 pieces gave log evidence within 4, 20 pieces up to 8 less."""


def wander(time: Variable, blocks: Sequence[slice]) -> list[Pattern]:
    """Return a random walk over the time within blocks, with an rms of one about its mean; none if time stands."""
    steps = np.diff(time.values, prepend=time.values[0])
    steps[[block.start for block in blocks]] = 0.0
    since = np.cumsum(steps)
    # The mean square deviation of a walk from its own mean is a sixth of its last variance.
    walk = Walk(np.linspace(0.0, since[-1], WALK_STEPS + 1), since[-1] / 6.0)
    return [Pattern.plain(Family.WANDER, (time,), walk.columns(since), walk)] if since[-1] > 0.0 else []
