"""Decide whether simulation and recording differ, and by which variable, form and size."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.table.data import OFFSET
from dbbstation.errors import CalibrationError
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import cancelling_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.coloured import widening_of
from dbbstation.inference.folds import held_out_error, parts_of, refits_without, selections_without, weighted_jackknife
from dbbstation.inference.followed import ChosenWithoutParts, WithoutPart, besides, left_without
from dbbstation.inference.harmonics import noise_of
from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels import OUT, Verdict, is_worse
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.read_off import Trial, read_off, values_of_members
from dbbstation.inference.settle import Beginning, settle, static_patterns
from dbbstation.inference.square_root import compress, solve
from dbbstation.inference.triangle import rms, root

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.table.data import Table
    from dbbstation.inference.alternatives import Cancelling
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.folds import HeldOutError
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.inference.settle import Settled
    from dbbstation.inference.square_root import Solution
    from dbbstation.laws.contract import TableSource, Texts

FAR_STATED = 3.0
"""Distance of a parameter from its stated value, in standard uncertainties, that is reported: one in 400 by chance."""


@dataclass(frozen=True)
class RefittedParameter:
    """A refitted parameter of the simulation.

    Attributes:
        before: value with the base alone, by ordinary least squares; uncertainty corrected for correlation.
        confounded: R² of its effect on findings.
        known: prior standard uncertainty; None if free.
        stated: whether the user stated the prior; otherwise it is twice the simulated difference.
        far: whether the change is so large that derivative or prior should be renewed.
    """

    name: str
    before: Value
    after: Value
    shift: float
    confounded: float
    known: float | None
    stated: bool
    far: bool


def refitted(
    name: str, before: Value, after: Value, confounded: float, known: float | None = None, *, stated: bool = False
) -> RefittedParameter:
    """Return a parameter before and after; arguments as of `RefittedParameter`."""
    far = known is not None and abs(after.value) > (FAR_STATED if stated else 1.0) * known
    return RefittedParameter(name, before, after, after.value - before.value, confounded, known, stated, far)


@dataclass(frozen=True, eq=False)
class Mismatch:
    """The answer on a table.

    Attributes:
        is_worse_here: whether the fit is worse than simulated on these rows.
        held_out: None if not tested.
    """

    table: Table
    settled: Settled
    findings: tuple[CauseFinding, ...]
    fitted: tuple[RefittedParameter, ...]
    left: LeftOver
    levels: Levels
    is_worse_here: bool
    held_out: HeldOutError | None
    lacking: dict[str, str]
    texts: dict[str, Texts]
    cancelling: Cancelling | None = None

    @property
    def there(self) -> tuple[CauseFinding, ...]:
        """Return findings that are present or happened."""
        return tuple(one for one in self.findings if one.verdict.is_there)

    @property
    def identified(self) -> tuple[CauseFinding, ...]:
        """Return findings that are present and, if tested, predict."""
        return tuple(one for one in self.findings if one.verdict is Verdict.IDENTIFIED)

    @property
    def is_worse(self) -> bool:
        """Return whether predictions are worse than simulated values, on held-out parts if tested."""
        return self.is_worse_here if self.held_out is None else self.held_out.is_worse

    @property
    def is_there(self) -> bool:
        """Return whether a difference remains beyond noise and base parameters."""
        return bool(self.settled.best.members) or not self.left.is_noise

    @property
    def stopped(self) -> str:
        """Return why the search ended early; empty if it did not."""
        return "the search reached its limit of work" if self.settled.stopped else ""

    @property
    def offset(self) -> Value | None:
        """Return the constant difference, or None if not fitted."""
        return next((one.before for one in self.fitted if one.name == OFFSET), None)

    @property
    def offset_is_there(self) -> bool:
        """Return whether the constant is significant."""
        return self.offset is not None and abs(self.offset.value) >= OUT * self.offset.uncertainty

    @property
    def parameters(self) -> tuple[RefittedParameter, ...]:
        """Return refitted parameters of the simulation."""
        return tuple(one for one in self.fitted if one.name != OFFSET)

    @property
    def explained(self) -> Floats:
        """Return the sum of findings and base parameters, all rows, shape (n,)."""
        return self.settled.predicted()

    @property
    def correction(self) -> Floats:
        """Return the sum of base parameters and effects over variables, all rows, shape (n,)."""
        return self.settled.channel.residual - left_without(self.settled, besides(self.settled, self.levels.corrects))

    @property
    def rms_before(self) -> float:
        """Return the rms after refitting base parameters, in the table's unit."""
        base = self.settled.channel.base.samples @ np.array([f.before.value for f in self.fitted])
        return rms(self.settled.channel.residual - base)

    @property
    def rms_after(self) -> float:
        """Return the rms after correction by all findings."""
        return rms(self.settled.left)


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
        hold_out: whether to repeat for each held-out part, which takes most of the time.
        matters: size of interest, in the table's unit; None for the refitted residual.

    Raises:
        CalibrationError: the difference is so large that rounding hides its variables.
    """
    with _precise(table):
        channel = table.channel(sources)
        channel = replace(channel, static=static_patterns(channel))
        settled = settle(channel, most_work=BOUNDS.work, progress=progress)
        chosen, held_out, residual = list[WithoutPart](), None, channel.residual

        def as_simulated(rows: Flags) -> Floats:
            return np.full(len(residual), float(np.mean(residual[rows])) if table.has_offset else 0.0)

        if hold_out:
            again = partial(chosen_again, beginning=settled.beginning)
            chosen = selections_without(channel, again, progress, alike=settled.noise.correlation_samples)
            held_out = held_out_error(channel, chosen, as_simulated)
        refits = refits_without(settled, [rows for _, rows in parts_of(channel)])
        is_worse_here = is_worse(rms(settled.left), rms(residual - as_simulated(channel.kept)))
        left = left_over(settled)
        parts = ChosenWithoutParts(chosen, held_out) if hold_out else None
        reference = None if held_out is None else held_out.as_simulated
        levels = levels_of(settled, left, parts, matters, reference=reference, worse=is_worse_here)
        if held_out is not None and parts is not None and settled.best.members:
            held_out = held_out.corrected(parts.errors_with(levels.corrects))
        values = [values_of_members(one.settled, one.settled.best.members) for one in chosen]
        findings = read_off(settled, Trial(parts, refits, values), levels)
        return Mismatch(
            table=table,
            settled=settled,
            findings=findings,
            fitted=_fitted(settled, table, refits),
            left=left,
            is_worse_here=is_worse_here,
            levels=levels,
            held_out=held_out,
            lacking=lacking or {},
            texts={source.name: source.texts for source in sources},
            cancelling=cancelling_of(settled, table.unit),
        )


@contextmanager
def _precise(table: Table) -> Iterator[None]:
    try:
        with np.errstate(over="raise"):
            yield
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        what = "the difference is so much larger than its noise that rounding hides what it follows"
        remedy = "check that measured and simulated values are of one quantity in the same unit"
        raise CalibrationError(
            what, where=f"{table.simulated_name} beside the measured values", remedy=remedy
        ) from error


@with_one_thread
def chosen_again(channel: Channel, *, beginning: Beginning = Beginning.EVERYTHING) -> Settled:
    """Repeat the selection by a smaller search, which can only increase the error."""
    return settle(
        channel.thinned(BOUNDS.fold_rows),
        most_expanded=0,
        thorough=False,
        beginnings=(beginning,),
        most_work=BOUNDS.work_without,
    )


def fitted_together(settled: Settled) -> Solution:
    """Return the fit of base, then best members, to all kept rows."""
    columns, both = settled.bank.jointly(settled.best.members)
    block = compress(np.arange(columns.shape[1]), columns, settled.bank.target)
    return solve([block], both, settled.noise.innovation, settled.channel.held)


def _fitted(settled: Settled, table: Table, refits: Sequence[Solution]) -> tuple[RefittedParameter, ...]:
    channel, size = settled.channel, settled.channel.base.samples.shape[1]
    alone = channel.fitted(channel.target, _noise_alone(channel))
    beside = fitted_together(settled)
    wider = widening_of(settled.bank.tails)
    before, after = np.diag(alone.covariance), wider * np.diag(beside.covariance)[:size]
    moved = weighted_jackknife(
        beside.x[:size],
        after,
        np.array([one.x[:size] for one in refits]),
        wider * np.array([np.diag(one.covariance)[:size] for one in refits]),
    )
    units = [channel.unit if name == OFFSET else "in its own unit" for name in channel.base.names]
    return tuple(
        refitted(
            name,
            Value(float(alone.x[k]), root(before[k]), units[k]),
            Value(float(beside.x[k]), root(after[k]), units[k]).at_least(float(moved[k])),
            float(np.clip(1.0 - before[k] / after[k], 0.0, 1.0)) if after[k] > 0.0 else 1.0,
            float(channel.base.prior[k]) if np.isfinite(channel.base.prior[k]) else None,
            stated=name in table.known,
        )
        for k, name in enumerate(channel.base.names)
    )


def _noise_alone(channel: Channel) -> float:
    left = channel.target - channel.base.samples[channel.kept] @ channel.refitted()
    runs = [left[rows] for rows in channel.stretches] if channel.time is not None else [left]
    found = noise_of(runs, channel.base.samples.shape[1])
    return max(found.effective if channel.time is not None else found.sigma, channel.least_noise, 1e-300)
