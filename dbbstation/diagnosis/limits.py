"""Limits reached by search, parameters, fit or interruption; uncertainty along held directions; biases of parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import remainder_of
from dbbstation.diagnosis.findings import Shift
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.verdict import LimitReached
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.explain import SettledCircles
    from dbbstation.inference.left_over import Remainder
    from dbbstation.model.observation import Observation


def where_left(observations: Sequence[Observation], found: Remainder) -> tuple[float, str]:
    """Return a sentence on size [µm] and place of the largest residual."""
    worst = min((found.harmonic, found.run, found.pulse), key=lambda one: one.probability)
    size_um = 1e3 * worst.rms
    if worst is found.harmonic:
        return size_um, f"Most of it comes {worst.place} times per turn, {size_um:.2g} µm rms over all runs."
    run = f"test {observations[worst.place].test} {observations[worst.place].raw.circle.direction}"
    if worst is found.run:
        return size_um, f"Most of it is in {run}, {size_um:.2g} µm rms."
    return size_um, f"Most of it is in {run} about {np.degrees(found.pulse_phase_rad):.0f} degrees, {size_um:.2g} µm."


def limits_of(settled: SettledCircles) -> tuple[LimitReached, ...]:
    """Return all limits, the search first."""
    found = []
    if settled.stopped:
        found.append(
            LimitReached("stopped", "", "Somebody stopped the comparison. This is the best that it had found.")
        )
    if settled.posterior.at_limit:
        _, where = where_left(settled.after.observations, remainder_of(settled.after, settled.noise))
        text = (
            f"The search ended at sets of {BOUNDS.members} causes, and a larger set is more probable. What is named stays. "
            f"The named causes leave {1e3 * settled.left.rms:.2g} µm rms beyond noise. {where}"
        )
        found.append(LimitReached("search", "", text))
    return (*found, *limits_of_fit(settled.after))


def limits_of_fit(fit: Calibration) -> tuple[LimitReached, ...]:
    """Return parameters at limits, and a last step without convergence."""
    found = [_at_end(fit, column) for column in fit.at_limit]
    if not fit.settled:
        text = "The joint fit still moved at its last step. Values and uncertainties are those of that step."
        found.append(LimitReached("fit", "", text))
    return tuple(found)


def _at_end(fit: Calibration, column: int) -> LimitReached:
    term = next(one for one in fit.layout.terms if one.columns.start <= column < one.columns.stop)
    parameter = term.parameters[column - term.columns.start]
    value = float(fit.x[column])
    end = "lower" if value <= float(np.mean(parameter.limits)) else "upper"
    text = (
        f"{term.source.name}: {parameter.name} is at the {end} end of its range, {value:.4g} {parameter.unit}. "
        "The true value may lie beyond it."
    )
    return LimitReached("parameter", f"{term.source.name} {parameter.name}", text)


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
