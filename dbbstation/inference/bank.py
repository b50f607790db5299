"""All candidate laws and patterns of a channel, as causes with columns."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import diags_array
from scipy.special import chdtri

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.coloured import (
    FEWEST_INDEPENDENT,
    Bands,
    Coloured,
    akaike_cost,
    autoregressive,
    bands_of,
    first_order,
    has_long_tails,
    largest_decay,
    log_student,
    most_probable_tails,
    most_probable_variance,
    spread_by_kind,
    with_put_back,
)
from dbbstation.inference.forms import modulated
from dbbstation.inference.harmonics import LEAST_LEFT
from dbbstation.inference.model_comparison import Cause, ModelComparison, Variant, largest_sd
from dbbstation.inference.patterns import NAMED, ZERO_SD, Family, log_odds, odds_of_driven
from dbbstation.inference.projection import BesideBase, CauseColumns
from dbbstation.inference.square_root import compress, solve, with_random
from dbbstation.inference.triangle import ROUNDING, rms

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from scipy.sparse import csr_array

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.channel import Channel, Law
    from dbbstation.inference.coloured import Left
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.patterns import Choices, Pattern
    from dbbstation.inference.square_root import Columns


LOOKED_FOR = frozenset({Family.WAVE, Family.BUMP, Family.STEP, Family.PULSES, Family.PULSES_BY_DIRECTION})
"""Families of patterns that were picked by a search of the residual."""


class Bank:
    """Candidate causes with their columns and the noise.

    Attributes:
        whitening: matrix over kept rows; None for uniform white noise.
        spread: relative noise of each kept row, shape (m,).
        tails: degrees of freedom of innovations; infinite if Gaussian.
        measures_beside_members: whether `measure` uses the hypothesis's residual instead of the residual of all causes.
        grows_with: variable on which the noise variance depends; may be empty.
        nameless: causes that never name an effect.
        refused: impossible laws, with reasons.
    """

    nameless: frozenset[str] = frozenset()

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self.measures_beside_members, self.long_tails = False, False
        self.patterns: dict[str, Pattern] = {}
        self.refused: dict[str, str] = {}
        self.laws: dict[str, Law] = {law.name: law for law in channel.laws}
        self.noise = Coloured(channel.size)
        self.whitening: csr_array | None = None
        self.spread = np.ones(len(channel.target))
        self.trust = np.ones(len(channel.target))
        self.tails, self.grows_with = np.inf, ""
        self._columns = CauseColumns(channel.base.samples[channel.kept], self._whitener())
        self._everywhere: list[Floats] = []
        self._of_patterns: dict[str, Cause] = {}
        self._of_laws = {law.name: Cause(law.name, self._on_a_grid(law), law.log_odds) for law in channel.laws}

    def copy(self) -> Bank:
        """Return a copy that shares present columns, laws and patterns; later additions are separate."""
        other: Bank = copy(self)
        other.patterns, other._of_patterns = dict(self.patterns), dict(self._of_patterns)
        other._of_laws, other._everywhere = dict(self._of_laws), list(self._everywhere)
        other.refused = dict(self.refused)
        other._columns = self._columns.copy()
        return other

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Return all causes that are not refused, laws first."""
        every = (*self._of_laws.values(), *self._of_patterns.values())
        return tuple(cause for cause in every if cause.name not in self.refused)

    def worthy(self, left: Left, found: Sequence[Pattern]) -> list[Pattern]:
        """Return patterns whose Bayes factor given the fit outweighs their prior odds."""
        found = [p for p in {p.name: p for p in found}.values() if p.name not in self.patterns]
        if not found:
            return []
        samples = self.whitened(np.hstack([p.samples for p in found]))
        taken = left.axes.T @ samples
        comparison = ModelComparison(samples.T @ samples - taken.T @ taken, samples.T @ left.rest)
        ends = np.cumsum([0, *(p.samples.shape[1] for p in found)])
        size = self.channel.size / left.noise
        causes = [self._cause(p, np.arange(a, b), size) for p, a, b in zip(found, ends[:-1], ends[1:], strict=True)]
        scan = comparison.scan((), causes)
        return [p for p, odds in zip(found, scan.log_odds, strict=True) if odds > 0.0]

    def of(self, name: str) -> Pattern | Law | None:
        """Return a cause's pattern or law; None for others."""
        return self.patterns.get(name) or self.laws.get(name)

    @property
    def count(self) -> int:
        """Return the total number of columns of all causes."""
        return self._columns.count

    @property
    def looked_for(self) -> set[str]:
        """Return names of patterns that a search picked."""
        return {name for name, pattern in self.patterns.items() if pattern.family in LOOKED_FOR}

    def kind_of(self, name: str) -> tuple[str, ...]:
        """Return a cause's name; for a picked pattern its family and variables."""
        pattern = self.patterns.get(name)
        if pattern is None or pattern.family not in LOOKED_FOR:
            return (name,)
        return (pattern.family, *(variable.name for variable in pattern.variables))

    def drop(self, names: Iterable[str]) -> None:
        """Remove picked patterns; their columns stay."""
        for name in names:
            del self.patterns[name], self._of_patterns[name]

    def samples(self, columns: Integers) -> Floats:
        """Return unwhitened columns over all rows, shape (n, p)."""
        starts = np.cumsum([0, *(part.shape[1] for part in self._everywhere)])
        found = np.empty((len(self.channel.residual), len(columns)))
        for k, column in enumerate(columns):
            part = int(np.searchsorted(starts, column, side="right")) - 1
            found[:, k] = self._everywhere[part][:, column - starts[part]]
        return found

    def fitted(self, columns: Integers) -> Floats:
        """Return whitened columns over kept rows, shape (m, p)."""
        return self._columns.of(columns)

    def jointly(self, members: Sequence[Member]) -> tuple[Floats, Columns]:
        """Return whitened columns of base and members over kept rows, shape (m, k), with their priors."""
        columns = np.hstack([self.base, *(self.fitted(member.columns) for member in members)])
        return columns, with_random(self.channel.known, [member.sd for member in members])

    def beside(self, but_for: Flags | None = None, only: Integers | None = None) -> BesideBase:
        """Return causes with the base projected out; `but_for` marks rows to ignore, shape (m,), whose target must be zero.

        Args:
            only: needed columns, ascending, shape (q,); None for all.
        """
        columns = self._columns if but_for is None else self._columns.but_for(but_for, only)
        return BesideBase(columns, self.channel.known, self.channel.held, self.noise.innovation)

    def without(self, rows: Flags, only: Integers | None = None) -> ModelComparison:
        """Return the comparison without some rows, shape (n,), with equal noise; `only` as for `beside`."""
        out = rows[self.channel.kept]
        return self.beside(out, only).comparison(np.where(out, 0.0, self.target))

    def add(self, more: Sequence[Pattern]) -> list[str]:
        """Add new patterns and return their names."""
        fresh = [p for p in {p.name: p for p in more}.values() if p.name not in self.patterns]
        if not fresh:
            return []
        self.patterns |= {p.name: p for p in fresh}
        for pattern in fresh:
            self._of_patterns[pattern.name] = self._cause(pattern, self._add(pattern.samples), self.channel.size)
        for name, cause in self._of_patterns.items():
            pattern = self.patterns[name]
            self._of_patterns[name] = replace(cause, log_prior_odds=self._odds(pattern))
        return [p.name for p in fresh]

    def measure(self, members: Sequence[Member] = ()) -> Coloured:
        """Estimate the noise from the residual of members, or first of all laws and patterns, and whiten columns.

        Picked patterns count only if they outweigh their odds, because chance peaks absorb noise.
        """
        least = max(ROUNDING * self.channel.size, self.channel.least_noise)
        stretches = self.channel.stretches
        for _ in range(BOUNDS.noise_rounds):
            beside = self.beside()
            target = self.target
            rng = np.random.default_rng(len(target))
            draws = rng.standard_normal((len(target), BOUNDS.noise_draws))
            sd = self._sizes(members) if self.measures_beside_members else self._taking_part(beside)
            left = beside.left(np.column_stack([target, draws]), sd)
            used = len(target) - float(np.mean(np.sum(left[:, 1:] ** 2, axis=0)))
            free = max(len(target) - used, 1.0)
            # Few remaining rows may give too small a noise by chance; more causes would enter and reduce it further.
            possible = free if self.channel.surely is None else float(chdtri(free, self.channel.surely))
            innovation = float(np.sqrt(np.sum(left[:, 0] ** 2) / possible))
            before, found = self.noise, self.noise.with_innovation(max(innovation, least))
            spread, grows_with = self._spread_of(left[:, 0])
            trust, tails = self.trust, np.inf
            if self.long_tails:
                trust, tails = most_probable_tails(left[:, 0] / self.trust / self.noise.innovation)
            changes = ((spread, self.spread), (trust, self.trust))
            uneven = max(float(np.abs(new / old - 1.0).max(initial=0.0)) for new, old in changes)
            if self.channel.time is not None and innovation > least:
                found = self._colour_of(left, draws, stretches, found)
            self._take(found, spread, trust)
            self.tails, self.grows_with = tails, grows_with
            if alike(found, before) and uneven < BOUNDS.noise_settled:
                break
        return self.noise

    def log_likelihood(self) -> float:
        """Return the kept rows' log likelihood for base and noise, up to a constant."""
        target, innovation = self.target, self.noise.innovation
        rest = target - self.base @ self.base_values(np.zeros(len(self.channel.residual)))
        seen = np.linalg.svd(self.base / innovation, compute_uv=False)
        seen = seen[seen > ROUNDING * seen[:1]]
        return self.log_level() - 0.5 * float(rest @ rest) / innovation**2 - float(np.log(seen).sum())

    def log_level(self) -> float:
        """Return the part of a log likelihood due to noise level and cost of noise parameters."""
        count = len(self.spread)
        uneven = 0.0 if self.whitening is None else float(np.log(self.whitening.diagonal()).sum())
        parameters = self.noise.parameters + (1 if np.isfinite(self.tails) else 0)
        if self.channel.levels is not None:
            parameters += int(self.channel.levels.max())
        cost = akaike_cost(parameters, count) + (float(np.log(count)) if self.grows_with else 0.0)
        return -count * float(np.log(self.noise.innovation)) + uneven - cost

    def tails_beyond(self, members: Sequence[Member]) -> float:
        """Return the log likelihood gain of Student's t over the weighted Gaussian."""
        if not np.isfinite(self.tails):
            return 0.0
        left = self.beside().left(self.target[:, None], self._sizes(members))[:, 0] / self.noise.innovation
        student = log_student(left / self.trust, self.tails)
        return float(np.sum(student - np.log(self.trust) + 0.5 * left**2))

    def may_have_long_tails(self, members: Sequence[Member]) -> bool:
        """Return whether innovations, with members fitted, have longer tails than normal."""
        left = self.beside().left(self.target[:, None], self._sizes(members))[:, 0]
        return has_long_tails(left / self.trust)

    def _spread_of(self, left: Floats) -> tuple[Floats, str]:
        if self.channel.levels is not None:
            return spread_by_kind(np.square(left * self.spread), self.channel.levels[self.channel.kept]), ""
        grows, known, follows = self.channel.grows, self.channel.known_noise, self.channel.noise_follows
        if grows is None and known is None and not follows:
            return self.spread, ""
        kept = self.channel.kept
        even = 1.0 + (
            np.zeros(len(left))
            if known is None
            else np.square(known[kept] / (self.noise.innovation * float(self.spread.min())))
        )
        powers = np.square(left * self.spread)
        surely = np.zeros((len(left), 0)) if grows is None else np.square(grows[kept].reshape(len(left), -1))
        cost, best = most_probable_variance(powers, even, surely, 0.0)
        name = ""
        for candidate, size in follows:
            odds = float(np.log(len(follows)))
            tried, spread = most_probable_variance(powers, even, np.column_stack([surely, np.square(size[kept])]), odds)
            if tried < cost:
                cost, best, name = tried, spread, candidate
        # A constant part also exists in the quietest rows.
        least = self.channel.least_noise / self.noise.innovation if name else 0.0
        return np.maximum(np.sqrt(best / np.mean(best)), least), name

    def _colour_of(self, left: Floats, draws: Floats, stretches: Sequence[slice], level: Coloured) -> Coloured:
        """Return the spectrum of the unwhitened noise, with absorbed power restored; only its level if the spectrum is unchanged."""
        pairs = [(bands_of(draws[:, k], stretches), bands_of(left[:, 1 + k], stretches)) for k in range(draws.shape[1])]
        taken = [r.log_power - w.log_power for w, r in pairs if w is not None and r is not None]
        bands = bands_of(left[:, 0], stretches)
        if bands is None or not taken:
            return level
        share = np.mean(taken, axis=0)
        seen = share > np.log(LEAST_LEFT)
        if not seen.any():
            return level
        found = None
        if self.measures_beside_members:
            found = autoregressive(self.noise.unwhitened(left[:, 0], stretches), stretches)
            if share.min() < np.log(HARDLY_TAKEN):
                found = with_put_back(found, bands.frequency[seen], share[seen], len(left))
        if found is None or found.independent_samples(stretches) < FEWEST_INDEPENDENT:
            # A process with few independent samples does not count as noise; causes may explain it.
            raw = bands.log_power - share + self.noise.log_power(bands.frequency) - 2.0 * np.log(self.noise.innovation)
            spectrum = Bands(bands.frequency[seen], raw[seen], bands.count[seen])
            found = first_order(spectrum, largest_decay(len(left)), oscillates=found is not None)
        # Once the spectrum is correct, squares give the best level.
        return level if alike(found.with_innovation(level.innovation), level) else found

    def _sizes(self, members: Sequence[Member]) -> Floats:
        sd = np.zeros(self._columns.count)
        for member in members:
            sd[member.columns] = member.sd
        return sd

    def _taking_part(self, beside: BesideBase) -> Floats:
        found = [self._of_patterns[name] for name in self._of_patterns if name in self.looked_for]
        idle: set[str] = set()
        if found:
            scan = beside.comparison(self.target).scan((), found)
            idle = {c.name for c, odds in zip(found, scan.log_odds, strict=True) if odds <= 0.0}
        return largest_sd((one for one in self.causes if one.name not in idle), self._columns.count)

    def _take(self, noise: Coloured, spread: Floats, trust: Floats) -> None:
        same = noise.partial == self.noise.partial and np.array_equal(spread, self.spread)
        same = same and np.array_equal(trust, self.trust)
        self.noise, self.spread, self.trust = noise, spread, trust
        if same:
            return
        self.whitening = noise.whitening(self.channel.stretches)
        if np.ptp(spread) > 0.0 or np.ptp(trust) > 0.0:
            even = diags_array(1.0 / spread).tocsr()
            self.whitening = even if self.whitening is None else self.whitening @ even
            self.whitening = diags_array(trust).tocsr() @ self.whitening
        base = self.whitened(self.channel.base.samples)
        self._columns = CauseColumns(base, self._whitener(), parts=self._everywhere)

    def whitened(self, rows: Floats) -> Floats:
        """Return the kept part of these rows, whitened, shape (m, ...)."""
        return _whitened(self.channel.kept, self.whitening, rows)

    def _whitener(self) -> Callable[[Floats], Floats]:
        return partial(_whitened, self.channel.kept, self.whitening)

    @property
    def target(self) -> Floats:
        """Return the whitened residual of kept rows, shape (m,)."""
        return self.whitened(self.channel.residual)

    @property
    def base(self) -> Floats:
        """Return the whitened base over kept rows, shape (m, k)."""
        return self._columns.base

    @property
    def axes(self) -> Floats:
        """Return orthonormal base axes over kept rows, shape (m, r)."""
        return self._columns.axes

    def base_values(self, effect: Floats) -> Floats:
        """Return the base's values, shape (k,), refitted to the residual minus an effect."""
        target = self.whitened(self.channel.residual - effect)
        block = compress(np.arange(self.base.shape[1]), self.base, target)
        return solve([block], self.channel.known, self.noise.innovation, self.channel.held).x

    def refine(self, name: str, nonlinear: tuple[float, ...], amplitudes: Floats) -> None:
        """Add columns of a law at parameter values, with tangents and slack.

        Args:
            amplitudes: of all the law's columns, shape (p,); zero outside this form.
        """
        law = self.laws[name]
        exact = law.columns(nonlinear) if law.at is None else law.at(nonlinear, amplitudes)
        spacings = [spacing_of(grid, value) for grid, value in zip(law.grids, nonlinear, strict=True)]
        tangents = tangents_of(law, nonlinear, amplitudes, spacings)
        slack = np.column_stack([*tangents, self._discrepancy(law, exact @ amplitudes, nonlinear, amplitudes)])
        own = self._add(np.hstack([exact, slack]))
        width = exact.shape[1]
        sd = np.concatenate([spacings, np.full(slack.shape[1] - len(tangents), law.form_uncertainty)])
        used, plausible = amplitudes != 0.0, law.plausible_of(exact)
        at = max(rms(amplitudes[used] / plausible[used]), 1e-12)
        points = float(np.prod([len(grid) for grid in law.grids]))
        # A tangent covers about 2.5 grid points of a nonlinear parameter.
        weight = -float(np.log(max(points / 2.5 ** len(law.grids), 1.0)))
        variants = tuple(
            replace(variant, slack=own[width:], slack_sd=sd, slack_at=at, tangents=len(tangents))
            for variant in _forms(law, own[:width], plausible, nonlinear, weight)
        )
        # What was laid out beside some causes may be better elsewhere beside others.
        before = self._of_laws[name]
        away = (v for v in before.variants if np.any(np.abs(np.subtract(v.nonlinear, nonlinear)) > spacings))
        self._of_laws[name] = replace(before, variants=(*variants, *away))

    def _discrepancy(self, law: Law, effect: Floats, nonlinear: tuple[float, ...], amplitudes: Floats) -> Floats:
        if law.form_uncertainty == 0.0:
            return np.zeros((len(effect), 0))
        if law.discrepancy is not None:
            return law.discrepancy(effect, nonlinear, amplitudes)
        if law.follows is None:
            return np.zeros((len(effect), 0))
        return modulated([effect[:, None]], [law.follows.values[:, None]], None)

    def _on_a_grid(self, law: Law) -> tuple[Variant, ...]:
        weight = -float(np.log(len(law.on_grid)))
        forms = (_forms(law, self._add(own), law.plausible_of(own), point, weight) for point, own in law.on_grid)
        return tuple(variant for some in forms for variant in some)

    def _cause(self, pattern: Pattern, own: Integers, plausible: float) -> Cause:
        slack = own[list(pattern.slack)]
        # A zero moves by the ratio of its column's value to the amplitudes.
        moved = np.full(len(slack), ZERO_SD * LARGE * plausible)
        whole = Variant(
            own, np.full(len(own), plausible), slack=slack, slack_sd=moved, slack_at=LARGE, tangents=len(slack)
        )
        choices = self._of_blocks() if pattern.family is Family.BLOCKS else pattern.choices
        return Cause(pattern.name, parts_of(whole, choices), self._odds(pattern), named=pattern.family in NAMED)

    def _of_blocks(self) -> Choices:
        half, names = float(np.log(0.5)), self.channel.names
        alone = (((k,), half - float(np.log(len(names))), name) for k, name in enumerate(names))
        return ((tuple(range(len(names))), half, ""), *alone)

    def _odds(self, pattern: Pattern) -> float:
        every = (*self.patterns.values(), pattern)
        over = {tuple(v.name for v in p.variables) for p in every if p.family is pattern.family}
        names = [variable.name for variable in self.channel.variables]
        rank = sum(names.index(variable.name) for variable in pattern.variables if variable.name in names)
        return log_odds(len(over), pattern.tried) + odds_of_driven(pattern.variables) - TIE * rank

    def _add(self, samples: Floats) -> Integers:
        self._everywhere.append(samples)
        return self._columns.add(samples)


def _whitened(kept: Flags, whitening: csr_array | None, rows: Floats) -> Floats:
    own = rows if kept.all() else rows[kept]  # selecting all rows would copy all columns
    return own if whitening is None else whitening @ own


def parts_of(whole: Variant, choices: Choices) -> tuple[Variant, ...]:
    """Return each choice of a form's amplitudes as a form; without choices only the whole."""
    return tuple(
        replace(
            whole,
            columns=whole.columns[list(part)],
            plausible=whole.plausible[list(part)],
            label=label,
            log_weight=whole.log_weight + weight,
            positive=tuple(whole.positive[k] for k in part) if whole.positive else (),
        )
        for part, weight, label in choices
    ) or (whole,)


def _forms(
    law: Law, columns: Integers, plausible: Floats, point: tuple[float, ...], log_weight: float
) -> tuple[Variant, ...]:
    every = columns if law.choices else columns[:0]
    whole = Variant(columns, plausible, point, whole=every, log_weight=log_weight, positive=law.positive)
    return parts_of(replace(whole, form_uncertainty=law.form_uncertainty), law.choices)


def tangents_of(law: Law, point: Sequence[float], amplitudes: Floats, spacings: Sequence[float]) -> list[Floats]:
    """Return numerical derivatives of a law's effect by each nonlinear parameter, shape (n,) each."""
    found = []
    for k, spacing in enumerate(spacings):
        ends = [
            [v + sign * BOUNDS.derivative_step * spacing * (i == k) for i, v in enumerate(point)]
            for sign in (1.0, -1.0)
        ]
        up, down = (law.columns(tuple(values)) @ amplitudes for values in ends)
        found.append((up - down) / (2.0 * BOUNDS.derivative_step * spacing))
    return found


def amplitudes_of(variant: Variant) -> Integers:
    """Return indices of a form's amplitudes within its law, shape (p,)."""
    if not len(variant.whole):
        return np.arange(len(variant.columns))
    return np.searchsorted(variant.whole, variant.columns)


def alike(one: Coloured, other: Coloured) -> bool:
    """Return whether two noise models have similar spectra and innovations."""
    pairs = ((one.innovation, other.innovation), (one.effective, other.effective))
    if any(abs(a - b) >= BOUNDS.noise_settled * max(a, b) for a, b in pairs):
        return False
    frequency = np.linspace(0.0, 0.5, BOUNDS.spectra_at)
    return float(np.abs(one.log_power(frequency) - other.log_power(frequency)).mean()) < 2.0 * BOUNDS.noise_settled


HARDLY_TAKEN = 0.95
"""Remaining share of noise above which absorbed power is not restored."""


LARGE = 2.0
"""Amplitude of a product, in plausible sizes, at which its slack is stated: `MOST_SLACK` times more, it fills the
largest scale."""

TIE = 1e-3
"""Difference in log odds between successive variables of a table, so that the first of two equal variables is named."""


def spacing_of(grid: Sequence[float], value: float) -> float:
    """Return a grid's spacing about a value; for a single point, its absolute value."""
    if len(grid) == 1:
        return max(abs(grid[0]), 1e-300)
    k = int(np.clip(np.searchsorted(grid, value), 1, len(grid) - 1))
    return float(grid[k] - grid[k - 1])
