"""The form of a circle in few numbers, and the circle that a run should show."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle

HIGHEST_HARMONIC = 3
"""Highest undulations per revolution in comparisons of runs. A wrong ball, bar, tilt or direction changes mean, centre,
ellipse and triangle; thousands of samples determine these seven numbers to hundredths of a micrometre."""

LOCAL_HARMONIC = 29
"""Highest undulations per revolution for comparing local events; higher ones serve to estimate noise."""

LOCAL_COEFFICIENTS = 2 * LOCAL_HARMONIC + 1
"""Number of coefficients of `local_columns`."""


def local_columns(theta_rad: Floats) -> Floats:
    """Return basis functions of an orthonormal form up to `LOCAL_HARMONIC` undulations, shape (n, 59)."""
    return _columns(theta_rad, LOCAL_HARMONIC)


COEFFICIENTS = 2 * HIGHEST_HARMONIC + 1
"""Coefficients of a form: its mean, and a cosine and a sine of each harmonic."""

HIGHER = (2, 3, 5, 6)
"""Indices of the second and third harmonics, which neither a ball's shift nor a bar's length changes."""


def form_columns(theta_rad: Floats) -> Floats:
    """Return basis functions of an orthonormal form, shape (n, 7)."""
    return _columns(theta_rad, HIGHEST_HARMONIC)


def _columns(theta_rad: Floats, highest: int) -> Floats:
    angles = np.outer(theta_rad, np.arange(1, highest + 1))
    return np.hstack([np.ones((len(theta_rad), 1)), np.sqrt(2.0) * np.cos(angles), np.sqrt(2.0) * np.sin(angles)])


def along_travel(circle: Circle) -> Floats:
    """Return the signs that convert coefficients to angles along the travel, shape (7,)."""
    return np.concatenate([np.ones(HIGHEST_HARMONIC + 1), np.full(HIGHEST_HARMONIC, circle.direction.sign)])


@dataclass(frozen=True, eq=False)
class Expected:
    """A circle as expected from the nominal machine or a model.

    Attributes:
        radial_mm: mean reading less nominal bar length.
        covariance_mm2: of centre and mean reading, with ball, mounting and bar, shape (3, 3).
        place_known: False for a ball set up under the spindle, whose centre is meaningless.
        reversals_deg: angles from +X at which a strut reverses.
        form_um: as `Seen.coefficients_um`, shape (7,).
        effects_um: changes of `form_um` by one standard deviation of each cause, shape (7, p) each; keys are the cause
            and the label of runs with shared values.
        local_um: the same for causes that depend on path or time, in `local_columns`, shape (59, p) each.
        moving: keys of causes that act only in motion.
        again_um2: covariance of the difference of two remounted runs, shape (7, 7).
        late_um2: covariance by causes that vary with time, at the run's time, shape (7, 7).
        place_um: stated standard deviation of the ball's place, CMM and holder, per axis.
        known_um2: covariance of a sound form with noise, given other tests, shape (7, 7); None without other tests.
    """

    centre_mm: Floats
    radial_mm: float
    covariance_mm2: Floats
    place_known: bool = True
    mounting_mm: float = 0.0
    reversals_deg: tuple[float, ...] = ()
    form_um: Floats = field(default_factory=lambda: np.zeros(COEFFICIENTS))
    effects_um: Mapping[tuple[str, str], Floats] = field(default_factory=dict)
    local_um: Mapping[tuple[str, str], Floats] = field(default_factory=dict)
    moving: frozenset[tuple[str, str]] = frozenset()
    again_um2: Floats = field(default_factory=lambda: np.zeros((COEFFICIENTS, COEFFICIENTS)))
    late_um2: Floats = field(default_factory=lambda: np.zeros((COEFFICIENTS, COEFFICIENTS)))
    place_um: float = 0.0
    known_um2: Floats | None = None
