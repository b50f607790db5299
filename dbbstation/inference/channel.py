"""A channel: what was measured less what was simulated, with everything that may have gone into the difference.

It knows no machine. A client brings residual rows in blocks, variables, base columns that are fitted anew with every
hypothesis, and laws: physical causes as columns. `settle` compares sets of laws and of patterns without physics.

    residual = base + sum of laws + sum of patterns + noise

Rows may be held back (`kept`): columns exist for all rows, and only the kept ones are fitted, so that the others can be
predicted.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dbbstation.inference.blocks import Block, Columns, compress
from dbbstation.inference.square_root import lost_directions, solve

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.curves import Clock
    from dbbstation.inference.patterns import Family, Pattern
    from dbbstation.inference.square_root import Solution
    from dbbstation.inference.variables import Variable

NAMED_ODDS = float(np.log(0.05 / 0.95))
"""Log prior odds of a law: one object in twenty has any one of them so that it matters."""

Discrepancy: TypeAlias = "Callable[[NDArray[np.float64], tuple[float, ...], NDArray[np.float64]], NDArray[np.float64]]"
"""What a formula may be off by, from its effect, nonlinear parameters and amplitudes."""

LARGEST = 10.0
"""Effect of a base column, in root mean squares of the residual, from which on its value is certainly of interest: what leaves a
base parameter more uncertain than that does not see it."""


@dataclass(frozen=True, eq=False)
class Base:
    """What is fitted anew with every hypothesis.

    Attributes:
        names: of the columns, shape (k,).
        samples: what one unit of each does to the residual, shape (n, k).
        prior: standard deviation of each about zero, infinite where nothing is known, shape (k,).
        random: which are effects of the set-up, averaged over rather than reported, shape (k,); those need a finite prior.
    """

    names: tuple[str, ...]
    samples: NDArray[np.float64]
    prior: NDArray[np.float64]
    random: NDArray[np.bool_]

    @classmethod
    def flat(cls, names: Sequence[str], samples: NDArray[np.float64]) -> Base:
        """Columns of which nothing is known beforehand."""
        count = samples.shape[1]
        return cls(tuple(names), samples, np.full(count, np.inf), np.zeros(count, dtype=bool))


@dataclass(frozen=True, eq=False)
class Law:
    """A physical cause, as columns.

    Attributes:
        name: unique in its channel.
        columns: what one unit of each amplitude does to the residual at values of the nonlinear parameters, over all rows, shape
            (n, p).
        plausible: usual size of each amplitude, one standard deviation, shape (p,).
        parameters: names of the amplitudes, then of the nonlinear parameters.
        grids: values of each nonlinear parameter to begin with, rising.
        positive: which amplitudes cannot be negative, shape (p,); empty where all can.
        form_uncertainty: share of the effect by which real objects depart from the formula, one standard deviation.
        follows: variable along which they do; None where the formula is exact or `discrepancy` says it.
        discrepancy: columns of what the formula may be off by, shape (n, q), from its effect, shape (n,), its nonlinear
            parameters and its amplitudes, shape (p,); `form_uncertainty` is their standard deviation. By default, the effect
            times smooth functions of `follows`.
        at: columns like `columns`, at values of the nonlinear parameters and about amplitudes, shape (p,), whose effect they give
            exactly; None where the effect is proportional to the amplitudes.
        choices: forms of which one is there, where there are several: the columns of each, its log probability, and what tells it
            from the others. None may be combined with `positive`.
        reach: largest effect of each amplitude, one standard deviation, whatever the nonlinear parameters are, in the unit of the
            residual; None: amplitudes have their `plausible` size at all of them.
        family: of patterns that it belongs to; None for physics of a client.
        variables: that it follows, where it belongs to a family.
        followed: names of what it follows, where these are no variables of the channel, such as a signal at a port.
        way: how it follows them, `direction` or `late`, where it belongs to no family; empty: by value.
        acts_once: no other rows can show it: a ball that was put up badly.
    """

    name: str
    columns: Callable[[tuple[float, ...]], NDArray[np.float64]]
    plausible: NDArray[np.float64]
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    grids: tuple[tuple[float, ...], ...] = ()
    positive: tuple[bool, ...] = ()
    form_uncertainty: float = 0.0
    follows: Variable | None = None
    discrepancy: Discrepancy | None = None
    log_odds: float = NAMED_ODDS
    at: Callable[[tuple[float, ...], NDArray[np.float64]], NDArray[np.float64]] | None = None
    choices: tuple[tuple[tuple[int, ...], float, str], ...] = ()
    reach: float | None = None
    family: Family | None = None
    variables: tuple[Variable, ...] = ()
    followed: tuple[str, ...] = ()
    way: str = ""
    acts_once: bool = False

    def plausible_of(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Usual size of each amplitude, shape (p,), whose columns are these, shape (n, p)."""
        if self.reach is None:
            return self.plausible
        return np.asarray(self.reach / np.maximum(np.abs(samples).max(axis=0), 1e-300))


@dataclass(frozen=True, eq=False)
class Channel:
    """Residual rows and what may have gone into them.

    Attributes:
        residual: measured less simulated, rows of a block together and in time order, shape (n,).
        blocks: rows of each block (run, file, day), covering all rows in order.
        variables: that effects without physics may follow.
        base: what is fitted anew with every hypothesis.
        laws: physical causes.
        time: of the rows, rising within blocks, shape (n,); None where their order means nothing.
        simulated: the simulated value as a variable, to ask whether it is late; None: it is not asked.
        kept: rows that are fitted, shape (n,); all if not given.
        apart: rows from one that is kept to the next one where none between them is held back.
        static: patterns that need no look, where they are known already or a client makes them itself; None: all kinds over all
            variables.
        least_noise: standard deviation of one row that is always there, whatever the rows seem to say: what the way they were
            made leaves of a perfect object, in the unit of the residual.
        step: that measured values are multiples of, in the unit of the residual; zero where they are of no step that is known.
        surely: probability that the noise is not more than it is taken for [interval of a variance by chi-square; JCGM 101:2008,
            sec. 6.4.9.4]; None: its estimate is taken, for which half of that is as good.
        grows: size of what a part of the noise may be in proportion to, beside a constant part, shape (n,); None: noise is the
            same in all rows.
        noise_follows: by name, sizes of what a part of the noise may be in proportion to, of which it follows one at the most,
            each of shape (n,).
        known_noise: standard deviation of noise that a row is known to have beyond that of the others, in the unit of the
            residual, shape (n,); None: no row is known to have more.
        levels: number of the kind of each row, from 0, where kinds of rows, such as outputs, have each a noise of a size of its
            own, shape (n,); None: all rows have the same.
        clock: of all rows, where some were left out or where they show a step by and by; None: they show it at once.
        direction: of travel as the rows show it, shape (n,); None: nothing is looked for in time that turns with it.
    """

    residual: NDArray[np.float64]
    unit: str
    blocks: tuple[slice, ...]
    names: tuple[str, ...]
    variables: tuple[Variable, ...]
    base: Base
    laws: tuple[Law, ...] = ()
    time: NDArray[np.float64] | None = None
    time_unit: str = "s"
    simulated: Variable | None = None
    kept: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    apart: int = 1
    static: tuple[Pattern, ...] | None = None
    least_noise: float = 0.0
    step: float = 0.0
    surely: float | None = None
    grows: NDArray[np.float64] | None = None
    noise_follows: tuple[tuple[str, NDArray[np.float64]], ...] = ()
    known_noise: NDArray[np.float64] | None = None
    levels: NDArray[np.int64] | None = None
    clock: Clock | None = None
    direction: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if not len(self.kept):
            object.__setattr__(self, "kept", np.ones(len(self.residual), dtype=bool))

    def without(self, rows: NDArray[np.bool_]) -> Channel:
        """The same with some rows held back, shape (n,)."""
        return replace(self, kept=self.kept & ~rows)

    def thinned(self, most: int) -> Channel:
        """The same with so many kept rows at the most, evenly spaced in each block."""
        apart = int(np.ceil(self.kept.sum() / most))
        if apart <= 1:
            return self
        grid = np.zeros(len(self.kept), dtype=bool)
        for rows in self.blocks:
            grid[rows.start : rows.stop : apart] = True
        return replace(self, kept=self.kept & grid, apart=apart)

    @property
    def target(self) -> NDArray[np.float64]:
        """Residual of the kept rows."""
        return self.residual[self.kept]

    @cached_property
    def size(self) -> float:
        """Root mean square of what the base leaves of the kept rows: no effect is much larger, in the unit of the residual."""
        left = self.target - self.base.samples[self.kept] @ self.fitted(self.target, self._about).x
        return max(
            float(np.sqrt(np.mean(left**2))),
            self.least_noise,
            1e-12 * float(np.abs(self.target).max(initial=0.0)),
            1e-300,
        )

    @cached_property
    def known(self) -> Columns:
        """Priors and scales of the base."""
        rms = np.sqrt(np.mean(self.base.samples[self.kept] ** 2, axis=0))
        scale = LARGEST * max(self._about, 1e-300) / np.maximum(rms, 1e-300)
        scale = np.where(np.isfinite(self.base.prior), np.minimum(self.base.prior, scale), scale)
        return Columns(self.base.prior, scale, self.base.random)

    @cached_property
    def held(self) -> NDArray[np.float64]:
        """Directions of the base that the rows do not see, kept at zero, shape (h, f)."""
        return lost_directions([self._block(self.target)], self.known, self._about)

    def fitted(self, target: NDArray[np.float64], noise: float) -> Solution:
        """Fit the base alone to kept rows of a target, at a noise of one row."""
        return solve([self._block(target)], self.known, noise, self.held)

    def refitted(self) -> NDArray[np.float64]:
        """Values of the base alone by ordinary least squares, shape (k,): what a person would refit who knows neither noise nor priors."""
        rows = self.base.samples[self.kept]
        scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        return np.asarray(np.linalg.lstsq(rows / scale, self.target, rcond=None)[0] / scale)

    @property
    def kept_blocks(self) -> list[slice]:
        """Blocks as slices of the kept rows; those that have none are left out."""
        counts = np.cumsum([0, *(int(self.kept[rows].sum()) for rows in self.blocks)])
        return [slice(int(a), int(b)) for a, b in pairwise(counts) if b > a]

    @property
    def stretches(self) -> list[slice]:
        """Kept rows that follow one another without a gap, as slices of the kept rows."""
        rows = np.flatnonzero(self.kept)
        block = np.searchsorted([b.stop for b in self.blocks], rows, side="right")
        edges = np.flatnonzero((np.diff(rows) != self.apart) | (np.diff(block) != 0)) + 1
        return [slice(int(a), int(b)) for a, b in pairwise([0, *edges, len(rows)])]

    @property
    def _about(self) -> float:
        """A first idea of the noise: the spread of the residual."""
        return max(
            float(np.std(self.target)), self.least_noise, 1e-12 * float(np.abs(self.target).max(initial=0.0)), 1e-300
        )

    def _block(self, target: NDArray[np.float64]) -> Block:
        return compress(np.arange(self.base.samples.shape[1]), self.base.samples[self.kept], target)
