"""Where a simulation and a recording differ: is there a mismatch, which variable leads it, which form it has, how large the residual is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.table.data import OFFSET
from dbbstation.errors import CalibrationError
from dbbstation.facts.value import Value
from dbbstation.inference.blocks import compress, with_random
from dbbstation.inference.cancelling import cancelling, effects_by_name
from dbbstation.inference.folds import held_out_error, parts_of
from dbbstation.inference.followed import ChosenWithoutParts, WithoutPart
from dbbstation.inference.jackknife import refits_without, weighted_jackknife
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.noise import noise_of
from dbbstation.inference.patterns import Family, covers_turns, turn
from dbbstation.inference.read_off import Trial, read_off
from dbbstation.inference.settle import settle, static_patterns
from dbbstation.inference.settled import Beginning
from dbbstation.inference.square_root import solve
from dbbstation.inference.verdict import OUT, Verdict, is_worse

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.table.contract import TableSource
    from dbbstation.diagnosis.table.data import Table
    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.folds import HeldOutError
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.patterns import Pattern
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.inference.settled import Settled
    from dbbstation.inference.square_root import Solution
    from dbbstation.text.texts import Texts

FAR_STATED = 3.0
"""Standard uncertainties by which a parameter is off what was stated of it from which on this is said: one in 400 by chance."""

FOLD_ROWS = 3000
"""Rows that a selection for a held-out part is made from, at the most, evenly spaced: fewer rows can only make its error larger."""


@dataclass(frozen=True)
class RefittedParameter:
    """A base parameter before and after.

    Attributes:
        before: with the base alone, by ordinary least squares; its uncertainty allows for neighbours that resemble each other.
        after: with what was found beside it.
        confounded: share of what the parameter does that this can do as well, R².
        known: standard uncertainty to which it was known before; None where it was free.
        stated: whether the user gave that; else it is what moves the simulated value twice as far as that was off.
    """

    name: str
    before: Value
    after: Value
    confounded: float
    known: float | None = None
    stated: bool = False

    @property
    def is_far(self) -> bool:
        """Whether it moved so far that its derivative, or what was known of it, must be asked again."""
        return self.known is not None and abs(self.after.value) > (FAR_STATED if self.stated else 1.0) * self.known


@dataclass(frozen=True)
class Share:
    """What of the mismatch follows one variable.

    Attributes:
        rms: of all effects over it, shared ones as well, in the unit of the table.
        share: of the reduction of the weighted sum of squares, what these bring alone.
        lost: what of it is lost without them, since others make up for part of them.
    """

    variable: str
    rms: float
    share: float
    lost: float
    terms: int


@dataclass(frozen=True, eq=False)
class Mismatch:
    """What is said of a table.

    Attributes:
        settled: what the comparison came to.
        shares: of variables, largest first.
        resembles: of smooth curves that are there, which named forms they follow: share of each, R², by name of finding.
        left: tests of the residual.
        levels: whether anything differs, what it follows, which law it is.
        is_worse_here: whether what was found leaves more of the rows than the values as simulated do.
        held_out: error of rows that took no part; None where it was not asked for.
        lacking: physics of the user's own that could not be asked, and why.
        texts: of that which was asked, by name.
        second_start: log odds of what a search that begins with nothing ends at, over what was found; zero where both are the
            same.
        cancelling: effects that cancel each other; None where they do not.
    """

    table: Table
    settled: Settled
    findings: tuple[CauseFinding, ...]
    shares: tuple[Share, ...]
    resembles: dict[str, dict[str, float]]
    fitted: tuple[RefittedParameter, ...]
    left: LeftOver
    levels: Levels
    is_worse_here: bool
    held_out: HeldOutError | None
    lacking: dict[str, str]
    texts: dict[str, Texts]
    second_start: float = 0.0
    cancelling: Cancelling | None = None

    @property
    def there(self) -> tuple[CauseFinding, ...]:
        """Findings of what is there, or happened once."""
        return tuple(one for one in self.findings if one.verdict in {Verdict.IDENTIFIED, Verdict.HAPPENED})

    @property
    def identified(self) -> tuple[CauseFinding, ...]:
        """Findings of what is there and predicts other rows, where that was asked."""
        return tuple(one for one in self.findings if one.verdict is Verdict.IDENTIFIED)

    @property
    def is_worse(self) -> bool:
        """Whether held-out parts, or where none were asked for all rows, are predicted worse than by the values as simulated."""
        return self.is_worse_here if self.held_out is None else self.held_out.is_worse

    @property
    def is_there(self) -> bool:
        """Whether measured and simulated values differ beyond noise and what base parameters take up."""
        return bool(self.settled.best.members) or not self.left.is_noise

    @property
    def offset(self) -> Value | None:
        """Constant that lies between measured and simulated values; None where there may be none."""
        return next((one.before for one in self.fitted if one.name == OFFSET), None)

    @property
    def offset_is_there(self) -> bool:
        """Whether a constant lies between them that is none of chance."""
        return self.offset is not None and abs(self.offset.value) >= OUT * self.offset.uncertainty

    @property
    def parameters(self) -> tuple[RefittedParameter, ...]:
        """Parameters of the simulation."""
        return tuple(one for one in self.fitted if one.name != OFFSET)

    @property
    def explained(self) -> NDArray[np.float64]:
        """What was found, base parameters included, over all rows, shape (n,)."""
        return self.settled.predicted()

    @property
    def rms_before(self) -> float:
        """Of the residual that base parameters leave, in the unit of the table."""
        base = self.settled.channel.base.samples @ np.array([f.before.value for f in self.fitted])
        return _rms(self.settled.channel.residual - base)

    @property
    def rms_after(self) -> float:
        """Of what everything found leaves."""
        return _rms(self.settled.channel.residual - self.explained)


@with_one_thread
def find_mismatch(
    table: Table,
    sources: Sequence[TableSource] = (),
    *,
    hold_out: bool = True,
    lacking: dict[str, str] | None = None,
    matters: float | None = None,
    progress: Callable[..., None] = lambda *_: None,
) -> Mismatch:
    """Compare measured with simulated values.

    Args:
        table: rows of all blocks.
        sources: physics of the user's own that the table has the columns for.
        hold_out: repeat everything for each held-out part; takes most of the time.
        lacking: physics that could not be asked, and why.
        matters: size of an effect that matters, in the unit of the table; None: what base parameters leave of the rows.
        progress: called with what is being done, and how much of how much where that can be counted.

    Raises:
        CalibrationError: the difference is so much larger than its noise that rounding hides what it follows.
    """
    try:
        with np.errstate(over="raise"):
            return _found(table, sources, lacking or {}, progress, hold_out=hold_out, matters=matters)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        what = "the difference is so much larger than its noise that rounding hides what it follows"
        remedy = "check that measured and simulated values are of one quantity in one unit"
        raise CalibrationError(
            what, where=f"{table.simulated_name} beside the measured values", remedy=remedy
        ) from error


def _found(
    table: Table,
    sources: Sequence[TableSource],
    lacking: dict[str, str],
    progress: Callable[..., None],
    *,
    hold_out: bool,
    matters: float | None,
) -> Mismatch:
    channel = table.channel(sources)
    channel = replace(channel, static=static_patterns(channel))
    settled = settle(channel, progress=progress)
    chosen: list[WithoutPart] = []
    held_out = _held_out(settled, table, chosen, progress) if hold_out else None
    refits = refits_without(settled, [rows for _, rows in parts_of(channel)])
    kept = channel.residual - (float(np.mean(channel.residual)) if table.has_offset else 0.0)
    is_worse_here = is_worse(_rms(channel.residual - settled.predicted()), _rms(kept))
    findings = read_off(settled, Trial(held_out, refits, is_worse_here=is_worse_here))
    left = left_over(settled)
    return Mismatch(
        table=table,
        settled=settled,
        findings=findings,
        shares=_shares(settled),
        resembles=_resembles(settled),
        fitted=_fitted(settled, table, refits),
        left=left,
        is_worse_here=is_worse_here,
        levels=levels_of(settled, left, ChosenWithoutParts(chosen) if hold_out else None, held_out, matters),
        held_out=held_out,
        lacking=lacking,
        texts={source.name: source.texts for source in sources},
        second_start=_second_start(settled, findings),
        cancelling=_cancelling(settled, table.unit),
    )


def _held_out(settled: Settled, table: Table, chosen: list[WithoutPart], progress: Callable[..., None]) -> HeldOutError:
    """Held-out error; the reference is the values as simulated, and a constant where one may lie between.

    What was chosen without each part is added to `chosen`.
    """
    residual = settled.channel.residual
    parts = iter(parts_of(settled.channel))

    def as_simulated(rows: NDArray[np.bool_]) -> NDArray[np.float64]:
        return np.full(len(residual), float(np.mean(residual[rows])) if table.has_offset else 0.0)

    def choose(channel: Channel, out: NDArray[np.bool_]) -> Settled:
        one = choose_without(channel, out, beginning=settled.beginning)
        chosen.append(WithoutPart(next(parts)[1], one))
        return one

    return held_out_error(
        settled.channel, choose, progress, alike=settled.noise.correlation_samples, reference=as_simulated
    )


@with_one_thread
def choose_without(
    channel: Channel, rows: NDArray[np.bool_], *, beginning: Beginning = Beginning.EVERYTHING
) -> Settled:
    """Repeat the whole selection without some rows, shape (n,), from one beginning of the noise.

    It is searched less widely than all rows are, from one beginning, which can only make the error of its predictions larger.
    """
    kept = channel.without(rows).thinned(FOLD_ROWS)
    return settle(kept, most_expanded=0, thorough=False, beginnings=(beginning,))


def _second_start(settled: Settled, findings: Sequence[CauseFinding]) -> float:
    """Log odds of another end of the search, zero where it is the same but for names that nothing here tells apart."""
    classes = {name: finding.name for finding in findings for name in finding.equivalent}
    other = settled.second_start()
    same = {classes.get(name, name) for name in other.names} == {classes.get(n, n) for n in settled.best.names}
    return 0.0 if same else other.log_posterior - settled.best.log_posterior


def _shares(settled: Settled) -> tuple[Share, ...]:
    """Variables by what of the explanation all that follows them brings alone."""
    comparison, best, patterns = settled.comparison, settled.best, settled.bank.patterns
    whole = comparison.explained(best.members) if best.members else 0.0
    found = []
    for variable in settled.channel.variables:
        own = [
            m.cause.name
            for m in best.members
            if m.cause.name in patterns and any(v.name == variable.name for v in patterns[m.cause.name].variables)
        ]
        if own:
            alone = [m for m in best.members if m.cause.name in own]
            rest = best.without(*own)
            share = comparison.explained(alone) / whole
            lost = max(1.0 - (comparison.explained(rest) if rest else 0.0) / whole, 0.0)
            found.append(Share(variable.name, _rms_about_mean(settled.effect(own)), share, lost, len(own)))
    return tuple(sorted(found, key=lambda share: -share.share))


def _resembles(settled: Settled) -> dict[str, dict[str, float]]:
    """Shares of curves that named forms of the same variable follow, alone and together."""
    found = {}
    for member in settled.best.members:
        pattern = settled.bank.patterns.get(member.cause.name)
        if pattern is None or pattern.family is not Family.CURVE:
            continue
        effect = settled.effect([member.cause.name])
        found[member.cause.name] = {name: _followed(effect, columns) for name, columns in _named_forms(pattern).items()}
    return found


def _named_forms(pattern: Pattern) -> dict[str, NDArray[np.float64]]:
    variable = pattern.variables[0]
    forms = {"linear": variable.scaled[:, None], "parabola": np.column_stack([variable.scaled, variable.scaled**2])}
    if covers_turns(variable):
        once, twice = (turn(variable, order).columns(variable.values) for order in (1, 2))
        forms |= {"once per turn": once, "twice per turn": twice, "once and twice per turn": np.hstack([once, twice])}
    return forms


def _followed(effect: NDArray[np.float64], columns: NDArray[np.float64]) -> float:
    both = np.column_stack([np.ones(len(effect)), columns])
    values, *_ = np.linalg.lstsq(both, effect, rcond=None)
    whole = float(np.sum((effect - effect.mean()) ** 2))
    return 1.0 - float(np.sum((effect - both @ values) ** 2)) / whole if whole > 0.0 else 0.0


def _cancelling(settled: Settled, unit: str) -> Cancelling | None:
    """Effects and parameters larger than all together, where most of their squares cancel."""
    base = settled.channel.base
    parameters = zip(base.names, settled.base_values(), strict=True)
    of_base = {n: base.samples[:, k] * v for k, (n, v) in enumerate(parameters)}
    return cancelling(effects_by_name(settled) | of_base, unit)


def _fitted(settled: Settled, table: Table, refits: Sequence[Solution]) -> tuple[RefittedParameter, ...]:
    """Base parameters with the base alone, and beside everything that was found; uncertainties as `read_off` has them."""
    channel, bank, members = settled.channel, settled.bank, settled.best.members
    noise, known, size = settled.noise.innovation, channel.known, channel.base.samples.shape[1]
    alone = channel.fitted(channel.target, _noise_alone(channel))
    beside = solve([compress(np.arange(size), bank.base, bank.target)], known, noise, channel.held)
    if members:
        columns = np.hstack([bank.base, *(bank.fitted(member.columns) for member in members)])
        both = with_random(known, np.concatenate([member.sd for member in members]))
        block = compress(np.arange(columns.shape[1]), columns, bank.target)
        beside = solve([block], both, noise, channel.held)
    before, after = np.diag(alone.covariance), np.diag(beside.covariance)[:size]
    moved = weighted_jackknife(
        beside.x[:size],
        after,
        np.array([one.x[:size] for one in refits]),
        np.array([np.diag(one.covariance)[:size] for one in refits]),
    )
    units = [channel.unit if name == OFFSET else "in its own unit" for name in channel.base.names]
    return tuple(
        RefittedParameter(
            name,
            Value(float(alone.x[k]), float(np.sqrt(max(before[k], 0.0))), units[k]),
            Value(float(beside.x[k]), float(np.sqrt(max(after[k], 0.0))), units[k]).at_least(float(moved[k])),
            float(np.clip(1.0 - before[k] / after[k], 0.0, 1.0)) if after[k] > 0.0 else 1.0,
            float(channel.base.prior[k]) if np.isfinite(channel.base.prior[k]) else None,
            name in table.known,
        )
        for k, name in enumerate(channel.base.names)
    )


def _noise_alone(channel: Channel) -> float:
    """Standard deviation of white noise that leaves values of the base alone as uncertain as what it leaves does."""
    left = channel.target - channel.base.samples[channel.kept] @ channel.refitted()
    runs = [left[rows] for rows in channel.stretches] if channel.time is not None else [left]
    found = noise_of(runs, channel.base.samples.shape[1])
    return max(found.effective if channel.time is not None else found.sigma, channel.least_noise, 1e-300)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _rms_about_mean(values: NDArray[np.float64]) -> float:
    return _rms(values - values.mean())
