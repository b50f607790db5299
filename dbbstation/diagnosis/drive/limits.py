"""What a recording cannot show, whatever the model: no acceleration, one speed, no reversal."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.design import BASE
from dbbstation.diagnosis.drive.sources.coulomb_friction import COULOMB_SHARE

if TYPE_CHECKING:
    from dbbstation.diagnosis.drive.design import Design
    from dbbstation.diagnosis.drive.fit import DriveFit

ACCELERATES = 5.0
"""Root mean square of the acceleration, over its noise, from which the mass can be told."""

TESTABLE_SIGMA = 5.0
"""An amplitude of the usual size must stand so far out of its standard deviation for a cause to be testable."""

VAGUE = 0.3
"""Relative standard uncertainty above which a mass is not known."""


@dataclass(frozen=True)
class Limits:
    """What cannot be told apart.

    Attributes:
        accelerates: beyond the noise of the acceleration.
        several_speeds: so that Coulomb friction would be told from viscous friction at its usual size.
        reverses: so that friction and constant load look different.
    """

    accelerates: bool
    several_speeds: bool
    reverses: bool


def limits_of(design: Design) -> Limits:
    """Look at what the drive did."""
    signals = design.signals
    acceleration = design.columns[:, 0]
    sign = signals.compared(signals.direction)
    base = design.columns[:, : len(BASE)]
    beside, *_ = np.linalg.lstsq(base, sign, rcond=None)
    seen = COULOMB_SHARE * signals.scale.force_n * np.linalg.norm(sign - base @ beside) / design.noise_n
    return Limits(
        accelerates=float(np.sqrt(np.mean(acceleration**2))) > ACCELERATES * signals.acceleration_noise_m_s2,
        several_speeds=bool(seen >= TESTABLE_SIGMA),
        reverses=bool(len(signals.reversals)),
    )


def mass_is_known(limits: Limits, fitted: DriveFit) -> bool:
    """Whether the recording tells the mass."""
    if not limits.accelerates:
        return False
    return bool(np.sqrt(fitted.covariance[0, 0]) < VAGUE * fitted.values[0])


def told(limits: Limits, design: Design, before: DriveFit, after: DriveFit) -> tuple[str, ...]:
    """Sentences for people: what cannot be told, what can be said still, and what to record."""
    sentences = []
    if not mass_is_known(limits, after):
        sentences.append(
            "The mass cannot be told: the drive hardly accelerates here, or the force does not answer to it. Record "
            "starts, stops and reversals."
        )
    if not limits.several_speeds:
        speed = float(np.median(np.abs(design.columns[:, 1])))
        force, sigma = before.values[1] * speed, np.sqrt(before.covariance[1, 1]) * speed
        sentences.append(
            "Viscous and Coulomb friction cannot be told apart at one speed. What is known is their sum at "
            f"{1e3 * speed:.4g} mm/s, {force:.4g} ± {sigma:.2g} N. Record at several speeds."
        )
    if not limits.reverses:
        sentences.append(
            "Coulomb friction and a constant load cannot be told apart, nor friction of the two directions: the drive "
            "never reverses. What is known is their sum in this direction. Record to and fro."
        )
    return tuple(sentences)
