"""A channel: measured minus simulated values over variables, with laws of stated physics as contributions.

A client supplies residual rows in blocks, variables, base columns and laws (physical causes as columns). Every
hypothesis refits the base. `settle` compares sets of laws and of patterns without physics.

residual = base + sum of laws + sum of patterns + noise

Columns cover all rows, but only `kept` rows are fitted, to predict the other rows. A variable is a column, in time order
within blocks. Its kind decides which effects are tried, such as waves of a turn for angles.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np

from dbbstation.inference.forms import Clock
from dbbstation.inference.square_root import Block, Columns, compress, lost_directions, slices, solve
from dbbstation.inference.triangle import ROUNDING, norms, rms

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.facts.value import Value
    from dbbstation.inference.model_comparison import Variant
    from dbbstation.inference.patterns import Choices, Family, Pattern
    from dbbstation.inference.square_root import Solution
    from dbbstation.laws.contract import SourceForm


class Kind(StrEnum):
    """Kinds of variables."""

    TIME = "time"
    ANGLE = "angle"
    LENGTH = "length"
    SPEED = "speed"
    FORCE = "force"
    TEMPERATURE = "temperature"
    ANY = "any"


TRAVELS = frozenset({Kind.ANGLE, Kind.LENGTH, Kind.FORCE, Kind.ANY})
"""Kinds whose direction of travel may matter, for play, friction and hysteresis."""

CONTINUOUS = 0.1
"""Largest median change between rows, relative to the range, of a variable sampled along a path; between separate poses
there is no speed."""

MANY = 10
"""Number of different values that suffices for every effect."""


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable that an error may follow.

    Attributes:
        period: one turn of an angle, in its unit; else None.
        driven: True if it results from the simulation, so the difference may cause it.
        range: range of the fitted rows, if different.
    """

    name: str
    unit: str
    kind: Kind
    values: Floats
    period: float | None = None
    driven: bool = False
    range: tuple[float, float] | None = None

    @property
    def low(self) -> float:
        """Return the least fitted value."""
        return float(self.values.min()) if self.range is None else self.range[0]

    @property
    def high(self) -> float:
        """Return the greatest fitted value."""
        return float(self.values.max()) if self.range is None else self.range[1]

    @property
    def distinct(self) -> int:
        """Return the number of different values; meaningless for rows that were not fitted."""
        return len(np.unique(self.values)) if self.range is None else len(self.values) + MANY

    @property
    def extent(self) -> float:
        """Return the range."""
        return self.high - self.low

    @property
    def scaled(self) -> Floats:
        """Return values scaled to -1..1, shape (n,)."""
        return (self.values - 0.5 * (self.low + self.high)) / (0.5 * self.extent)

    @property
    def half_range(self) -> float:
        """Return the length of one scaled unit in the variable's unit."""
        return 0.5 * self.extent

    def travel(self, rows: slice) -> Floats:
        """Return values over consecutive rows, angles unwrapped."""
        own = self.values[rows]
        if self.period is None or self.extent > self.period:
            return own
        return np.unwrap(own, period=self.period)

    def is_path(self, blocks: Sequence[slice]) -> bool:
        """Return whether the variable changes continuously, as along a path."""
        steps = [np.abs(np.diff(self.travel(rows))) for rows in blocks]
        every = np.concatenate([np.zeros(0), *steps])
        return len(every) > 0 and float(np.median(every)) < CONTINUOUS * self.extent

    def directions(self, blocks: Sequence[slice]) -> Floats:
        """Return each row's direction: 1 up, -1 down, shape (n,).

        Along a path, speed gives the direction; between poses, the previous pose. Stationary rows keep the last
        direction; before a block's first motion they have the next direction.
        """
        central = self.is_path(blocks)
        return _signs(self, blocks, lambda own: np.gradient(own) if central and len(own) > 1 else _arriving(own))

    def arriving(self, blocks: Sequence[slice]) -> Floats:
        """Return directions from the previous row alone, for ambiguous turning points."""
        return _signs(self, blocks, _arriving)

    def rates(self, time: Floats, blocks: Sequence[slice]) -> Floats:
        """Return speeds by central differences within blocks, shape (n,); zero if time does not advance."""
        found = np.zeros(len(self.values))
        for rows in blocks:
            own, at = self.travel(rows), time[rows]
            if len(own) > 1 and np.all(np.diff(at) > 0.0):
                found[rows] = np.gradient(own, at)
        return found


def _arriving(values: Floats) -> Floats:
    return np.diff(values, prepend=values[:1])


def _signs(variable: Variable, blocks: Sequence[slice], change_of: Callable[[Floats], Floats]) -> Floats:
    found = np.zeros(len(variable.values))
    for rows in blocks:
        change = change_of(variable.travel(rows))
        moved = np.where(np.abs(change) > ROUNDING * variable.extent, np.sign(change), 0.0)
        first = int(np.argmax(moved != 0.0)) if moved.any() else 0
        last = np.maximum.accumulate(np.where(moved != 0.0, np.arange(len(moved)), first))
        found[rows] = moved[last] if len(moved) else moved
    return found


NAMED_ODDS = float(np.log(0.05 / 0.95))
"""Log prior odds of a law or a named cause: each one matters in one object of twenty."""

Discrepancy: TypeAlias = "Callable[[Floats, tuple[float, ...], Floats], Floats]"
"""A function that returns possible formula errors from effect, nonlinear parameters and amplitudes."""

LARGEST = 10.0
"""Effect of a base column, over the residual's rms, that certainly matters; a base parameter with more uncertainty
counts as undetermined."""


@dataclass(frozen=True, eq=False)
class Base:
    """Columns refitted with every hypothesis.

    Attributes:
        samples: effect of one unit, shape (n, k).
        prior: standard deviation about zero, infinite if unknown, shape (k,).
        random: set-up effects to marginalise, with finite prior, shape (k,).
    """

    names: tuple[str, ...]
    samples: Floats
    prior: Floats
    random: Flags

    @classmethod
    def flat(cls, names: Sequence[str], samples: Floats) -> Base:
        """Return a base of columns without priors."""
        count = samples.shape[1]
        return cls(tuple(names), samples, np.full(count, np.inf), np.zeros(count, dtype=bool))


@dataclass(frozen=True, eq=False)
class Law:
    """A physical cause, described by columns.

    Attributes:
        columns: effects of unit amplitudes at given nonlinear parameters, all rows, shape (n, p).
        plausible: one standard deviation of amplitudes, shape (p,).
        grids: starting values of nonlinear parameters, ascending.
        positive: amplitudes that cannot be negative, shape (p,); may be empty.
        form_uncertainty: relative departure of real objects from the formula, one standard deviation.
        follows: variable that this departure follows; None if exact or given by `discrepancy`.
        discrepancy: function from effect, shape (n,), nonlinear parameters and amplitudes, shape (p,), to columns of
            departure, shape (n, q), with standard deviation `form_uncertainty`. Default: the effect times smooth
            functions of `follows`.
        at: function from nonlinear parameters and amplitudes, shape (p,), to linearised columns; None if proportional.
        choices: alternative forms: columns, log probability, label.
        zero_from: reference value of the first variable; the effect is zero at this value minus the ratio of second to
            first amplitude. None without such a zero.
        reach: prior standard deviation of each amplitude's greatest effect, in the residual's unit; None to use
            `plausible`.
        family: of a pattern; None for a client's physics.
        followed: names followed instead of variables, such as port signals.
        driven: followed names that result from the simulation.
        way: `direction` or `late` for laws without family; empty for value.
        acts_once: whether it is a single event that other rows cannot show.
        confirm: a measurement that shows this cause alone; empty if unknown.
        possible: function that tests its values and other laws' values, by name.
    """

    name: str
    columns: Callable[[tuple[float, ...]], Floats]
    plausible: Floats
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    grids: tuple[tuple[float, ...], ...] = ()
    positive: tuple[bool, ...] = ()
    form_uncertainty: float = 0.0
    follows: Variable | None = None
    discrepancy: Discrepancy | None = None
    log_odds: float = NAMED_ODDS
    at: Callable[[tuple[float, ...], Floats], Floats] | None = None
    choices: Choices = ()
    zero_from: float | None = None
    reach: float | None = None
    family: Family | None = None
    variables: tuple[Variable, ...] = ()
    followed: tuple[str, ...] = ()
    driven: frozenset[str] = frozenset()
    way: str = ""
    acts_once: bool = False
    confirm: str = ""
    possible: Callable[[Mapping[str, float]], bool] = lambda _: True

    @classmethod
    def of(cls, name: str, form: SourceForm, columns: Callable[[tuple[float, ...]], Floats], **further: Any) -> Self:  # noqa: ANN401 - other fields
        """Return the law of a stated form.

        Args:
            columns: function from nonlinear parameters to columns of amplitudes, shape (n, p).
        """
        every = (*form.amplitudes, *form.shapes)
        return cls(
            name=name,
            columns=columns,
            plausible=np.array([p.plausible for p in form.amplitudes]),
            parameters=tuple(p.name for p in every),
            units=tuple(p.unit for p in every),
            grids=tuple(p.grid for p in form.shapes),
            positive=tuple(p.positive for p in form.amplitudes),
            **further,
        )

    @cached_property
    def on_grid(self) -> tuple[tuple[tuple[float, ...], Floats], ...]:
        """Return each combination of starting values with its columns, shape (n, p)."""
        return tuple((point, self.columns(point)) for point in product(*self.grids))

    def plausible_of(self, samples: Floats) -> Floats:
        """Return prior standard deviations of amplitudes, shape (p,), for columns, shape (n, p)."""
        if self.reach is None:
            return self.plausible
        return self.reach / np.maximum(np.abs(samples).max(axis=0), 1e-300)


@dataclass(frozen=True, eq=False)
class Channel:
    """Residual rows and possible contributions.

    Attributes:
        residual: measured less simulated, by block in time order, shape (n,).
        blocks: rows of each block, covering all in order.
        time: ascending within blocks, shape (n,); None for unordered rows.
        simulated: simulated values, to test delays; None for no test.
        kept: fitted rows, shape (n,); default all.
        apart: spacing of kept rows, ignoring gaps of held-back rows.
        static: patterns that need no search; None for all kinds over all variables.
        least_noise: least noise of a row, in the residual's unit.
        step: resolution of measured values, in the residual's unit; zero if unknown.
        surely: probability of the noise bound [interval of a variance by chi-square; JCGM 101:2008, sec. 6.4.9.4]; None
            for the estimate.
        grows: size of a proportional noise component, shape (n,); None for constant noise.
        noise_follows: alternative sizes of this component by name, shape (n,) each; at most one applies.
        known_noise: additional standard deviation per row, in the residual's unit, shape (n,); or None.
        levels: kind of each row, from 0, shape (n,); each kind has separate noise. None for one kind.
        clock: for omitted rows or gradual steps; None for immediate steps.
        direction: of travel, shape (n,); None to omit direction-dependent effects in time.
        interchangeable: share of a fitted effect's squares that a cause over another variable must explain for both
            variables to be named. The remainder is then less than a third of the effect; 0.8 and 0.95 gave equal
            answers on ten tables. Circles and sessions use the share of equivalent causes, because there a tenth
            changes log evidence by thousands.
        rows_are: name of the rows in answers: `rows` or `tests`.
    """

    residual: Floats
    unit: str
    blocks: tuple[slice, ...]
    names: tuple[str, ...]
    variables: tuple[Variable, ...]
    base: Base
    laws: tuple[Law, ...] = ()
    time: Floats | None = None
    time_unit: str = "s"
    simulated: Variable | None = None
    kept: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    apart: int = 1
    static: tuple[Pattern, ...] | None = None
    least_noise: float = 0.0
    step: float = 0.0
    surely: float | None = None
    grows: Floats | None = None
    noise_follows: tuple[tuple[str, Floats], ...] = ()
    known_noise: Floats | None = None
    levels: Integers | None = None
    clock: Clock | None = None
    direction: Floats | None = None
    interchangeable: float = 0.9
    rows_are: str = "rows"

    def __post_init__(self) -> None:
        if not len(self.kept):
            object.__setattr__(self, "kept", np.ones(len(self.residual), dtype=bool))

    def without(self, rows: Flags) -> Channel:
        """Return the channel with marked rows, shape (n,), held back."""
        return replace(self, kept=self.kept & ~rows)

    def thinned(self, most: int) -> Channel:
        """Return the channel with at most `most` kept rows, evenly spaced in each block."""
        apart = int(np.ceil(self.kept.sum() / most))
        if apart <= 1:
            return self
        grid = np.zeros(len(self.kept), dtype=bool)
        for rows in self.blocks:
            grid[rows.start : rows.stop : apart] = True
        return replace(self, kept=self.kept & grid, apart=apart)

    @cached_property
    def row_clock(self) -> Clock:
        """Return the clock, by default of gapless rows with immediate response."""
        return Clock.plain(len(self.residual)) if self.clock is None else self.clock

    @property
    def target(self) -> Floats:
        """Return the residual of the kept rows."""
        return self.residual[self.kept]

    @cached_property
    def size(self) -> float:
        """Return the residual's rms after the base fit, an upper bound of effects."""
        return self._at_least(rms(self.target - self.base.samples[self.kept] @ self.fitted(self.target, self._about).x))

    @cached_property
    def known(self) -> Columns:
        """Return priors and scales of the base."""
        rms = np.sqrt(np.mean(self.base.samples[self.kept] ** 2, axis=0))
        scale = LARGEST * max(self._about, 1e-300) / np.maximum(rms, 1e-300)
        scale = np.where(np.isfinite(self.base.prior), np.minimum(self.base.prior, scale), scale)
        return Columns(self.base.prior, scale, self.base.random)

    @cached_property
    def held(self) -> Floats:
        """Return base directions that the rows do not determine, held at zero, shape (h, f)."""
        return lost_directions([self._block(self.target)], self.known, self._about)

    def fitted(self, target: Floats, noise: float) -> Solution:
        """Fit the base to kept rows of a target with given noise per row."""
        return solve([self._block(target)], self.known, noise, self.held)

    def refitted(self) -> Floats:
        """Return the base's ordinary least-squares values, shape (k,)."""
        rows = self.base.samples[self.kept]
        scale = norms(rows)
        return np.linalg.lstsq(rows / scale, self.target, rcond=None)[0] / scale

    @property
    def kept_blocks(self) -> list[slice]:
        """Return blocks as slices of kept rows, without empty ones."""
        every = slices(int(self.kept[rows].sum()) for rows in self.blocks)
        return [rows for rows in every if rows.stop > rows.start]

    @property
    def stretches(self) -> list[slice]:
        """Return gapless stretches as slices of kept rows."""
        rows = np.flatnonzero(self.kept)
        block = np.searchsorted([b.stop for b in self.blocks], rows, side="right")
        edges = np.flatnonzero((np.diff(rows) != self.apart) | (np.diff(block) != 0)) + 1
        return [slice(int(a), int(b)) for a, b in pairwise([0, *edges, len(rows)])]

    @property
    def _about(self) -> float:
        return self._at_least(float(np.std(self.target)))

    def _at_least(self, size: float) -> float:
        return max(size, self.least_noise, 1e-12 * float(np.abs(self.target).max(initial=0.0)), 1e-300)

    def _block(self, target: Floats) -> Block:
        return compress(np.arange(self.base.samples.shape[1]), self.base.samples[self.kept], target)


NEGATIVE_SIGMA = 3.0
"""Standard deviations below zero at which a non-negative parameter is impossible: one in 700 by chance."""


def impossible(law: Law, variant: Variant, values: Floats, covariance: Floats, least: float = NEGATIVE_SIGMA) -> str:
    """Return why a form's amplitudes are impossible, else an empty text; arguments as of `impossibly_negative`."""
    for k, (positive, name, unit) in enumerate(zip(variant.positive, law.parameters, law.units, strict=False)):
        value = float(values[k])
        sigma = float(np.hypot(np.sqrt(covariance[k, k]), law.form_uncertainty * value))
        if positive and (why := impossibly_negative(name, value, sigma, unit, least)):
            return why
    return ""


BEYOND = 5.0
"""Largest rms of an effect over a variable, relative to the whole difference; a larger effect would mostly cancel with
others."""


def beyond_reach(law: Law, rms: float) -> str:
    """Return why an effect of a pattern is too large, else an empty text."""
    if law.family is None or law.reach is None or rms <= BEYOND * law.reach:
        return ""
    return f"It would have to be {rms / law.reach:.2g} times the difference itself, and cancel with others."


def impossible_beside(law: Law, values: Mapping[str, Value], every: Mapping[str, float]) -> str:
    """Return why a law's values contradict the values of other laws, else an empty text."""
    if law.possible(every):
        return ""
    shown = ", ".join(f"{name} {value.value:.3g} {value.unit}" for name, value in values.items())
    return f"It would have to be {shown}, which it cannot be beside the rest: something else is at work."


def impossibly_negative(name: str, value: float, sigma: float, unit: str, least: float = NEGATIVE_SIGMA) -> str:
    """Return why a value below zero by so many standard deviations is impossible, else an empty text."""
    if value >= -least * sigma:
        return ""
    return (
        f"It would have to be negative, {name} {value:.3g} ± {sigma:.2g} {unit}, which it "
        "cannot be: something else that does the opposite is at work."
    )
