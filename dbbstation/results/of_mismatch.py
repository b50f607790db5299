"""Make the result of a table's comparison."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.diagnosis.table.next_measurement import next_measurements
from dbbstation.diagnosis.table.words import sentence_of
from dbbstation.facts.value import finite
from dbbstation.results.frame import of_facts
from dbbstation.results.mismatch import (
    HeldOutRms,
    MismatchResult,
    NoiseResult,
    OffsetResult,
    ResidualRms,
    SearchBeginning,
    VariableResult,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dbbstation.diagnosis.table.mismatch import Mismatch


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
        offset=_offset(found),
        noise=_noise(found),
        residual_rms=ResidualRms(found.rms_before, found.rms_after),
        held_out="not-tested" if found.held_out is None else "tested",
        held_out_rms=_held_out(found),
        findings=tuple(replace(one, text=sentence_of(found, one)) for one in found.findings),
        parameters=found.fitted,
        next=next_measurements(found),
        not_asked=found.lacking,
        table={} if table is None else table,
        drawing=drawing,
        notes=notes,
    )


def _offset(found: Mismatch) -> OffsetResult | None:
    if found.offset is None:
        return None
    known = found.offset
    return OffsetResult(known.value, known.uncertainty, known.unit, found.offset_is_there)


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


def _held_out(found: Mismatch) -> HeldOutRms | None:
    held_out = found.held_out
    if held_out is None:
        return None
    return HeldOutRms(held_out.as_simulated, held_out.before, held_out.after, found.is_worse, held_out.folds)
