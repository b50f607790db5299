"""Known shapes of single faults of serial axes.

Radial deviations, outwards positive, over θ from +X towards +Y at radius R; d is +1 for increasing θ. To first order,
errors e_x, e_y cause e_x cos θ + e_y sin θ.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle


class Signature(StrEnum):
    """The classical signatures."""

    SQUARENESS = "squareness"
    SCALE = "scale mismatch"
    SERVO = "servo mismatch"
    BACKLASH = "backlash step"
    SPIKE = "reversal spike"
    CYCLIC = "cyclic error"


ENDS = {"+X": 0.0, "+Y": 90.0, "-X": 180.0, "-Y": 270.0}
"""Angles at which an axis reverses [deg]."""


@dataclass(frozen=True)
class SignatureColumn:
    """One column of the fit.

    Attributes:
        place: end or axis; empty for both.
    """

    signature: Signature
    place: str
    unit: str


def shapes_of(theta_deg: Floats, circle: Circle, spike_deg: float) -> dict[SignatureColumn, Floats]:
    """Return the deviations by unit signatures [µm], shape (n,) each; docs/circles.md has the formulas.

    Args:
        theta_deg: shape (n,).
        circle: radius, feed, sense.
    """
    theta, sign = np.radians(theta_deg), circle.direction.sign
    radius_mm = circle.radius_mm
    cosine, sine = np.cos(theta), np.sin(theta)
    feed_um_ms = circle.feed_mm_min / 60.0
    found = {
        SignatureColumn(Signature.SQUARENESS, "", "µm/m"): -5e-4 * radius_mm * np.sin(2.0 * theta),
        SignatureColumn(Signature.SCALE, "", "µm/m"): 5e-4 * radius_mm * np.cos(2.0 * theta),
        SignatureColumn(Signature.SERVO, "", "ms"): 0.5 * sign * feed_um_ms * np.sin(2.0 * theta),
    }
    along = {"X": (cosine, -sign * sine), "Y": (sine, sign * cosine)}
    for end in ENDS:
        at, speed = along[end[1]]
        share = 0.5 * (1.0 + at) if end[0] == "+" else 0.5 * (1.0 - at)
        found[SignatureColumn(Signature.BACKLASH, end, "µm")] = -0.5 * np.sign(speed) * at * share
    for end, end_deg in ENDS.items():
        behind = np.mod(sign * (theta_deg - end_deg), 360.0)
        found[SignatureColumn(Signature.SPIKE, end, "µm")] = np.where(
            behind < spike_deg, np.sin(np.pi * np.minimum(behind / spike_deg, 1.0)), 0.0
        )
    return found


def cyclic_shapes(theta_deg: Floats, circle: Circle, axis: str, period_mm: float) -> Floats:
    """Return deviations by unit sine and cosine errors, periodic in an axis's position from the centre, shape (n, 2) [µm].

    Args:
        theta_deg: shape (n,).
        axis: `X` or `Y`.
    """
    theta = np.radians(theta_deg)
    along = np.cos(theta) if axis == "X" else np.sin(theta)
    phase = 2.0 * np.pi * circle.radius_mm / period_mm * along
    return np.column_stack([along * np.sin(phase), along * np.cos(phase)])
