"""Steps at axis reversals, and undulations of the form."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import hypot_of, sum_of
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.inference.harmonics import amplitudes

if TYPE_CHECKING:
    from dbbstation.circles.path import CirclePath
    from dbbstation.computing.arrays import Floats
    from dbbstation.trace.recording import RawCircle

AXES_DEG = (0.0, 90.0, 180.0, 270.0)
"""Angles at which the machine's X and Y reverse."""

NEAR_DEG, FAR_DEG = 1.5, 12.0
"""Arc on each side of a place for the fitted lines [deg]: near enough for straight lines to follow low harmonics, but
outside the transition."""

HIGHEST_HARMONIC = 10
"""Highest undulations per revolution with a reported amplitude."""

FEWEST = 6
"""Fewest samples of a fitted line."""


@dataclass(frozen=True)
class ReversalStep:
    """The path's step at a place, along the travel.

    Attributes:
        height_um: outwards positive.
    """

    theta_deg: float
    height_um: float
    u_um: float


@dataclass(frozen=True)
class Harmonic:
    """An undulation A cos k(θ - θ_0) about the least-squares circle.

    Attributes:
        peak_deg: first peak θ_0 from +X, below 360 / k.
    """

    undulations: int
    amplitude_um: float
    peak_deg: float


def step_at(raw: RawCircle, deviation_um: Floats, theta_deg: float, sigma_um: float) -> ReversalStep | None:
    """Return the step at a place from fits on both sides; None for few samples or at the turn's ends (`closure_of`).

    Args:
        deviation_um: shape (n,).
    """
    place = float(raw.circle.phi_deg(np.array([theta_deg]))[0])
    if not FAR_DEG <= place <= FULL_TURN_DEG - FAR_DEG:
        return None
    before, behind = (_line_at(raw.phi_deg - place, deviation_um, side, sigma_um) for side in (-1.0, 1.0))
    return _between(theta_deg, before, behind)


def closure_of(raw: RawCircle, deviation_um: Floats, sigma_um: float) -> ReversalStep | None:
    """Return the turn's end less its beginning; None for too few samples."""
    beginning = _line_at(raw.phi_deg, deviation_um, 1.0, sigma_um, near_deg=0.0)
    end = _line_at(raw.phi_deg - FULL_TURN_DEG, deviation_um, -1.0, sigma_um, near_deg=0.0)
    return _between(raw.circle.start_deg, beginning, end)


def _between(
    theta_deg: float, before: tuple[float, float] | None, behind: tuple[float, float] | None
) -> ReversalStep | None:
    if before is None or behind is None:
        return None
    return ReversalStep(theta_deg, behind[0] - before[0], hypot_of(before[1], behind[1]))


def _line_at(
    away_deg: Floats,
    values: Floats,
    side: float,
    sigma: float,
    near_deg: float = NEAR_DEG,
) -> tuple[float, float] | None:
    beside = side * away_deg
    inside = (beside >= near_deg) & (beside <= FAR_DEG)
    if np.count_nonzero(inside) < FEWEST:
        return None
    x = away_deg[inside]
    middle = x.mean()
    spread = sum_of((x - middle) ** 2)
    weight = 1.0 / len(x) - middle * (x - middle) / spread
    return float(weight @ values[inside]), sigma * sqrt(weight @ weight)


def harmonics_of(path: CirclePath) -> tuple[Harmonic, ...]:
    """Return undulations 2 to 10 per revolution about the least-squares circle."""
    orders = np.arange(1, HIGHEST_HARMONIC + 1)
    found = amplitudes(1e3 * path.least_squares.deviation_mm, np.radians(path.theta_deg), HIGHEST_HARMONIC)
    cosine, sine = found.real[1:], -found.imag[1:]
    peaks = np.mod(np.degrees(np.arctan2(sine, cosine)) / orders, FULL_TURN_DEG / orders)
    return tuple(
        Harmonic(int(k), hypot_of(c, s), float(peak))
        for k, c, s, peak in zip(orders, cosine, sine, peaks, strict=True)
        if k > 1
    )
