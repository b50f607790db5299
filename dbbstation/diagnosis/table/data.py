"""A table of measured and simulated values, and its channel."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bent import LawRows, bent_laws, grows_with, is_same, memory_laws
from dbbstation.inference.channel import Base, Channel, Kind, Law, Variable
from dbbstation.inference.triangle import ROUNDING, rms
from dbbstation.laws.contract import SourceForm

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.laws.contract import TableSource

REFITTED = 2.0
"""Prior standard deviation of a free parameter's effect, over the rms error as simulated. Half or double changes no
verdict of three tables; of a fourth, half puts one parameter beyond its stated value [docs/validation.md]."""

OFFSET = "offset"
"""Name of the constant base column."""


@dataclass(frozen=True, eq=False)
class Table:
    """Rows by block in time order.

    Attributes:
        measured: shape (n,).
        simulated: shape (n,).
        derivatives: of the simulated value by parameter name, shape (n,).
        columns: numeric, by name, shape (n,).
        known: prior standard uncertainty by parameter name.
        like: the table to which effects were fitted, if different.
    """

    measured: Floats
    simulated: Floats
    unit: str
    simulated_name: str
    variables: tuple[Variable, ...]
    derivatives: Mapping[str, Floats]
    columns: Mapping[str, Floats]
    blocks: tuple[slice, ...]
    names: tuple[str, ...]
    clock: Variable | None
    in_row_order: bool = False
    known: Mapping[str, float] = field(default_factory=dict)
    free: frozenset[str] = frozenset()
    has_offset: bool = True
    like: Table | None = None

    def __len__(self) -> int:
        return len(self.measured)

    @property
    def is_ordered(self) -> bool:
        """Return whether rows are ordered in time."""
        return self.clock is not None or self.in_row_order

    def spread_of(self, name: str) -> float:
        """Return a parameter's prior standard deviation; infinite if free."""
        if name == OFFSET or name in self.free:
            return np.inf
        if name in self.known:
            return self.known[name]
        # A change far above the original error is no plausible correction of a parameter.
        moves = rms(self.derivatives[name])
        off = float(np.std(self.measured - self.simulated))
        return REFITTED * off / moves if moves > 0.0 and off > 0.0 else np.inf

    def channel(self, sources: Sequence[TableSource] = ()) -> Channel:
        """Return the channel of measured minus simulated values."""
        columns = {OFFSET: np.ones(len(self)), **self.derivatives} if self.has_offset else dict(self.derivatives)
        samples = np.column_stack([np.zeros((len(self), 0)), *columns.values()])
        fitted = self.like or self
        limits = None if self.like is None else (float(fitted.simulated.min()), float(fitted.simulated.max()))
        simulated = Variable(self.simulated_name, self.unit, Kind.ANY, self.simulated, range=limits)
        time = None if self.clock is None else self.clock.values
        if time is None and self.in_row_order:
            time = np.arange(len(self), dtype=np.float64)
        follows = self.variables
        if fitted.simulated_is_variable:
            follows = (*follows, simulated)
        time_unit = self.clock.unit if self.clock is not None and self.clock.unit else "row"
        laws = [self._law(source) for source in sources]
        if (size := float(np.std(fitted.measured - fitted.simulated))) > 0.0:
            own = Variable(self.simulated_name, self.unit, Kind.ANY, fitted.simulated)
            over = (*fitted.variables, own) if fitted.simulated_is_variable else fitted.variables
            grows = grows_with(over, fitted.simulated, size)
            rows = LawRows(time, time_unit, self.blocks, size, self.unit)
            laws += [*bent_laws(rows, follows, grows), *memory_laws(rows, follows)]
        return Channel(
            residual=self.measured - self.simulated,
            unit=self.unit,
            blocks=self.blocks,
            names=self.names,
            variables=follows,
            base=Base(
                tuple(columns), samples, np.array([*map(self.spread_of, columns)]), np.zeros(len(columns), dtype=bool)
            ),
            laws=tuple(laws),
            time=time,
            time_unit=time_unit,
            simulated=simulated,
            least_noise=rounding_of(self.measured),
            step=step_of(self.measured),
            noise_follows=tuple(_sizes_of_noise(follows, time, self.blocks)),
        )

    @property
    def simulated_is_variable(self) -> bool:
        """Return whether the simulated value varies and equals no other variable."""
        return bool(np.ptp(self.simulated) > 0.0) and not any(is_same(v.values, self.simulated) for v in self.variables)

    def _law(self, source: TableSource) -> Law:
        form = SourceForm(source.parameters(), source.columns)
        given = {name: self.columns[name] for name in source.needs}
        along = source.follows or (source.needs[0] if source.needs else "")
        follows = next((v for v in self.variables if v.name == along), None)
        if follows is None and along in self.columns:
            follows = Variable(along, "", Kind.ANY, self.columns[along])

        return Law.of(
            source.name, form, partial(form.at, given), form_uncertainty=source.form_uncertainty, follows=follows
        )


def _sizes_of_noise(
    variables: Sequence[Variable], time: Floats | None, blocks: Sequence[slice]
) -> Iterator[tuple[str, Floats]]:
    """Return candidate sizes of proportional noise: distances from range ends, and speeds."""
    for variable in variables:
        yield f"{variable.name} less its least value", variable.values - variable.low
        yield f"its largest value less {variable.name}", variable.high - variable.values
        if time is not None and variable.kind is not Kind.TIME and variable.is_path(blocks):
            yield f"speed of {variable.name}", np.abs(variable.rates(time, blocks))


def step_of(values: Floats) -> float:
    """Return the largest step of which all values, shape (n,), are multiples."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > ROUNDING * np.ptp(values)]
    return float(steps.min()) if len(steps) else 0.0


def rounding_of(values: Floats) -> float:
    """Return rounding's standard deviation [JCGM 100:2008, sec. F.2.2.1]."""
    return step_of(values) / float(np.sqrt(12.0))
