"""Uncertainty along directions that the fit holds at nominal, and biases of machine parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.findings import Shift
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats


def uncertainties(calibration: Calibration, held: Floats) -> Floats:
    """Return every column's standard uncertainty, shape (k,), including `held_variance`."""
    seen = np.maximum(calibration.solution.variance, 0.0)
    return np.sqrt(seen + held_variance(calibration, held))


def held_variance(calibration: Calibration, held: Floats) -> Floats:
    """Return every column's variance along held directions, shape (k,)."""
    # A source may have its found or plausible size there, whichever is greater. For example, a ball displaced by 70 µm
    # in determined directions may be displaced by 20 µm in others.
    known = calibration.layout.known
    fitted = np.flatnonzero(~known.random)
    amplitudes = calibration.x[fitted] / known.scale[fitted]
    hidden = np.sum(calibration.solution.held**2, axis=0)
    square = np.ones(len(known.random))
    for name, least in {term.source.name: term.source.concealed_times**2 for term in calibration.layout.terms}.items():
        columns, _ = calibration.layout.columns_of(name)
        own = np.isin(fitted, columns)
        seen = float(np.sum(1.0 - hidden[own]))
        found = float(np.sum(amplitudes[own] ** 2)) / seen if seen > HALF else 0.0
        square[columns] = max(least, found)
    along = held**2 @ square[fitted]
    variance = np.zeros(len(known.random))
    variance[fitted] = along @ (held * known.scale[fitted]) ** 2
    return variance


def unseen(calibration: Calibration) -> Floats:
    """Return undetermined directions as orthonormal rows for the model file, shape (h, f)."""
    fitted = np.flatnonzero(~calibration.layout.known.random)
    return calibration.null_space[:, fitted] / calibration.layout.known.scale[fitted]


def held_beside(before: Calibration, after: Calibration) -> Floats:
    """Return directions that only the joint fit holds, shape (h, f); the base's directions are conventions."""
    wide = np.zeros((len(before.solution.held), after.solution.held.shape[1]))
    wide[:, : before.solution.held.shape[1]] = before.solution.held
    beyond = after.solution.held - (after.solution.held @ wide.T) @ wide
    _, size, rows = np.linalg.svd(beyond, full_matrices=False)
    return rows[size > HALF]


HALF = float(np.sqrt(0.5))
"""Least length of a separate direction after projecting out the base's directions, and least determined share of a
source's amplitudes that gives the size of the others."""


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
