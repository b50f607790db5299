"""Bias of machine parameters by physics missing from the earlier calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.diagnosis.findings import Shift
from dbbstation.diagnosis.held import held_beside, uncertainties
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration


def shifts_between(before: Calibration, after: Calibration) -> tuple[Shift, ...]:
    """Return biases of machine parameters, largest first; may be empty."""
    if after is before:
        return ()
    row_of = {name: k for k, name in enumerate(after.layout.names)}
    sigma = uncertainties(after, held_beside(before, after))
    shifts = []
    for term in before.layout.terms:
        if term.source.belongs_to is not Owner.MACHINE:
            continue
        for k, parameter in enumerate(term.parameters):
            row = row_of[term.source.name, term.shared, parameter.name]
            old, new = 1e3 * float(before.x[term.columns.start + k]), 1e3 * float(after.x[row])
            name = f"{term.source.name} {parameter.name.removesuffix('_mm')}"
            shifts.append(Shift(name, old, new, old - new, 1e3 * float(sigma[row])))
    return tuple(sorted(shifts, key=lambda shift: -abs(shift.shift_um)))
