"""Limits reached by search, parameters, fit or interruption, and where the largest residual is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import remainder_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.verdict import LimitReached

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.diagnosis.explained import SettledCircles
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
