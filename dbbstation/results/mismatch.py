"""The result of `mismatch`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from dbbstation.diagnosis.table.mismatch import RefittedParameter
from dbbstation.diagnosis.table.next_measurement import Next, next_measurements
from dbbstation.diagnosis.table.words import sentence_of
from dbbstation.facts import BeforeAfter, of_facts
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import Value, finite
from dbbstation.files.csv_rows import table_csv
from dbbstation.files.provenance import Provenance, write_table
from dbbstation.inference.alternatives import Cancelling
from dbbstation.inference.folds import Fold
from dbbstation.inference.left_over import LeftOver
from dbbstation.inference.levels import Levels
from dbbstation.inference.read_off import CauseFinding
from dbbstation.results.frame import Framed
from dbbstation.results.levels_text import level_sentences

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.diagnosis.table.mismatch import Mismatch


@dataclass(frozen=True)
class VariableResult:
    """A column that the difference may follow.

    Attributes:
        period: period of the column in its unit, or None.
    """

    name: str
    kind: str
    unit: str
    period: float | None
    low: float
    high: float


@dataclass(frozen=True)
class OffsetResult(Value):
    """Mean of measured minus simulated values."""

    significant: bool


@dataclass(frozen=True)
class SearchBeginning:
    """The result of a search from one initial noise model."""

    beside: str
    log_odds: float
    effects: tuple[str, ...]


@dataclass(frozen=True)
class NoiseResult:
    """Noise of one row.

    Attributes:
        rows_as_one: correlated neighbours that count as one row.
        measured_in_order: whether the row order is known.
        degrees_of_freedom: of Student's t; None for normal noise.
    """

    sigma: float
    rows_as_one: float
    measured_in_order: bool
    order: int
    degrees_of_freedom: float | None
    grows_with: str | None
    beginnings: tuple[SearchBeginning, ...]


@dataclass(frozen=True)
class HeldOutRms:
    """Errors of all held-out parts, in the table's unit.

    Attributes:
        worse: whether corrected values predict worse than simulated ones.
    """

    as_simulated: float
    before: float
    after: float
    worse: bool
    folds: tuple[Fold, ...]


@dataclass(frozen=True, kw_only=True)
class MismatchResult(Framed):
    """Findings in a table of measured and simulated values.

    Attributes:
        levels: existence, variables and law of a difference.
        offset: mean difference; None if not allowed.
        not_asked: own physics not tested, with reasons by name.
        table: columns by name, with corrected simulation and residual.
    """

    unit: str
    row_count: Annotated[int, Field(serialization_alias="rows")]
    blocks: tuple[str, ...]
    variables: tuple[VariableResult, ...]
    levels: Levels
    mismatch: bool
    offset: OffsetResult | None
    noise: NoiseResult
    residual_rms: BeforeAfter
    held_out: str
    held_out_rms: HeldOutRms | None
    cancelling: Cancelling | None
    findings: tuple[CauseFinding, ...]
    parameters: tuple[RefittedParameter, ...]
    left: LeftOver
    next: tuple[Next, ...]
    not_asked: Mapping[str, str]
    stopped: str
    corrected: Annotated[str | None, Absent] = None
    figure: Annotated[str | None, Absent] = None
    table: Annotated[Mapping[str, tuple[str | float, ...]], AsItIs, Kept]
    _table_of = "findings", "name, verdict, probability, log_bayes_factor, rms, confounded, text"

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words."""
        found = level_sentences(self.levels, self.unit, {one.name: one.values for one in self.findings})
        if self.offset is not None and self.offset.significant:
            found[0] += f" On average they differ by {self.offset.in_words}, which is fitted and not counted here."
        return found

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        write_table(path, table_csv(list(self.table), list(self.table.values())), provenance, force=force)


def mismatch_result(
    found: Mismatch,
    *,
    table: Mapping[str, tuple[str | float, ...]] | None = None,
    drawing: Callable[[object], bytes] | None = None,
    notes: tuple[str, ...] = (),
) -> MismatchResult:
    """Return the result of a table."""
    compared = found.table
    return of_facts(
        MismatchResult,
        found,
        unit=compared.unit,
        row_count=len(compared),
        blocks=compared.names,
        variables=tuple(
            VariableResult(v.name, str(v.kind), v.unit, v.period, float(v.low), float(v.high))
            for v in compared.variables
        ),
        mismatch=found.is_there,
        offset=found.offset and OffsetResult(**vars(found.offset), significant=found.offset_is_there),
        noise=_noise(found),
        residual_rms=BeforeAfter(found.rms_before, found.rms_after),
        held_out="not-tested" if found.held_out is None else "tested",
        held_out_rms=found.held_out and of_facts(HeldOutRms, found.held_out, worse=found.is_worse),
        findings=tuple(replace(one, text=sentence_of(found, one)) for one in found.findings),
        parameters=found.fitted,
        next=next_measurements(found),
        not_asked=found.lacking,
        table={} if table is None else table,
        drawing=drawing,
        notes=notes,
    )


def _noise(found: Mismatch) -> NoiseResult:
    settled, noise = found.settled, found.settled.noise
    return NoiseResult(
        sigma=noise.sigma,
        rows_as_one=noise.correlation_samples,
        measured_in_order=settled.channel.time is not None,
        order=noise.order,
        degrees_of_freedom=finite(settled.bank.tails),
        grows_with=settled.bank.grows_with or None,
        beginnings=tuple(
            SearchBeginning(
                one.beginning.value, one.log_probability - settled.log_probability, tuple(sorted(one.best.names))
            )
            for one in (settled, *settled.others)
        ),
    )
