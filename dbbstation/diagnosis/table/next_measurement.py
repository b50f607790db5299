"""Propose the next measurements for a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import TRAVELS, Kind

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.diagnosis.table.mismatch import Mismatch

ALIKE = 0.95
"""Correlation above which rows hardly distinguish two variables: only a tenth of the variance differs."""

TAKEN_UP = 0.9
"""Share of a parameter's effect that findings can also explain, above which its value depends on their selection."""


@dataclass(frozen=True)
class Next:
    """One proposed measurement."""

    text: str
    variables: tuple[str, ...]


@with_one_thread
def next_measurements(found: Mismatch) -> tuple[Next, ...]:
    """Return proposals, the most decisive first."""
    return tuple(list(_suggested(found))[: BOUNDS.measurements])


def _suggested(found: Mismatch) -> Iterator[Next]:
    yield from _apart(found)
    for parameter in found.parameters:
        if parameter.confounded > TAKEN_UP:
            text = f"Measure where {parameter.name} matters and what was found does not: {100 * parameter.confounded:.0f} % of it"
            yield Next(f"{text} can be taken for these.", ())
    if not found.table.is_ordered:
        text = "Record the time of each row, or say `--time rows`: without order there is no drift, pulse, lag or direction."
        yield Next(text, ())
    yield from _denser(found)
    yield from _rest_of_turns(found)
    yield from _other_way(found)
    if len(found.table.blocks) == 1:
        yield Next(
            "Repeat the measurement on another day as a second file: effects that return belong to the object, the others to the day.",
            (),
        )


def _denser(found: Mismatch) -> Iterator[Next]:
    worst = found.left.worst
    if not found.left.is_noise and worst.name in {v.name for v in found.settled.channel.variables}:
        yield Next(f"Measure more densely in {worst.name}, {worst.where}: something is left there.", (worst.name,))


def _rest_of_turns(found: Mismatch) -> Iterator[Next]:
    led = {name for finding in found.there for name in finding.variables}
    for variable in found.settled.channel.variables:
        if variable.name in led and variable.period is not None and variable.extent < WHOLE * variable.period:
            covered = 100.0 * variable.extent / variable.period
            text = f"Measure the rest of the turn of {variable.name}: these rows cover {covered:.0f} % of it."
            yield Next(text, (variable.name,))


WHOLE = 0.95
"""Share of a turn that counts as a whole turn."""


def _other_way(found: Mismatch) -> Iterator[Next]:
    table = found.table
    for variable in found.settled.channel.variables if table.is_ordered else ():
        if variable.kind in TRAVELS and variable.name != table.simulated_name:
            sign = variable.directions(table.blocks)
            if min((sign > 0).sum(), (sign < 0).sum()) < ONE_WAY * len(table):
                text = f"Measure {variable.name} in both directions of travel: hysteresis cannot show one way."
                yield Next(text, (variable.name,))


ONE_WAY = 0.02
"""Share of rows in the rarer direction below which travel counts as one-way."""


def _apart(found: Mismatch) -> Iterator[Next]:
    variables = [v for v in found.settled.channel.variables if v.name != found.table.simulated_name]
    led = {name for finding in found.findings if finding.verdict.may_be_there for name in finding.variables}
    values = np.array([v.scaled for v in variables])
    if len(values) < 2:  # noqa: PLR2004 - a pair
        return
    alike = np.abs(np.corrcoef(values))
    for a, one in enumerate(variables):
        for b, other in enumerate(variables[:a]):
            if alike[a, b] > ALIKE and led & {one.name, other.name}:
                held, moving = (one, other) if one.kind is Kind.TIME else (other, one)
                how = f"Measure with {held.name} held while {moving.name} moves"
                if held.kind is Kind.TIME:  # cannot be kept constant
                    how = f"Measure with another curve of {moving.name} over {held.name}"
                text = (
                    f"{how}: they move together here (correlation {alike[a, b]:.3f}), so that these "
                    f"rows do not show which one the mismatch follows."
                )
                yield Next(text, (other.name, one.name))
