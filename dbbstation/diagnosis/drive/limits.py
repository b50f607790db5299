"""Find which parameters recordings cannot determine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.channel import MASS, VISCOUS
from dbbstation.facts.value import Value
from dbbstation.inference.triangle import norms, rms
from dbbstation.inference.verdict import OUT
from dbbstation.laws.friction import COULOMB_SHARE

if TYPE_CHECKING:
    from dbbstation.diagnosis.drive.explain import ExplainedDrive

ACCELERATES = 5.0
"""Least ratio of the acceleration's rms to its noise that determines the mass."""

VAGUE = 0.3
"""Relative standard uncertainty above which a value counts as unknown."""


@dataclass(frozen=True)
class DriveLimits:
    """Parameters that cannot be distinguished."""

    accelerates: bool
    several_speeds: bool
    reverses: bool


def limits_of(explained: ExplainedDrive) -> DriveLimits:
    """Return the limits of the motion.

    Coulomb friction must be significant given mass, viscous friction and a delay, which ramps cannot separate.
    """
    recordings, bank = explained.drive.recordings, explained.settled.bank
    acceleration = recordings.motion[:, 0]
    sign = recordings.compared(lambda s: s.direction)
    late = recordings.compared(lambda s: np.gradient(s.force_n, 1.0 / s.rate_hz))
    columns = bank.whitened(np.column_stack([recordings.motion, late, sign]))
    columns = columns / norms(columns) * np.linalg.norm(columns[:, -1])
    beside, *_ = np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=None)
    rest = float(np.linalg.norm(columns[:, -1] - columns[:, :-1] @ beside))
    seen = COULOMB_SHARE * recordings.scale.force_n * rest / explained.settled.noise.innovation
    noise = float(np.sqrt(np.mean([one.acceleration_noise_m_s2**2 for one in recordings.signals])))
    return DriveLimits(
        accelerates=rms(acceleration) > ACCELERATES * noise,
        several_speeds=bool(seen >= OUT),
        reverses=recordings.scale.both_ways,
    )


def mass_is_known(limits: DriveLimits, mass: Value | None) -> bool:
    """Return whether mass is determined."""
    return mass is not None and limits.accelerates and mass.uncertainty < VAGUE * mass.value


def sentences(limits: DriveLimits, explained: ExplainedDrive, known: dict[str, bool]) -> tuple[str, ...]:
    """Return sentences on undetermined numbers and further recordings."""
    sentences = list(explained.dropped.values())
    if not known[MASS] and MASS not in explained.dropped:
        sentences.append(
            "The mass cannot be determined: the drive hardly accelerates here, or the force does not answer to it. Record "
            "starts, stops and reversals."
        )
    if not limits.several_speeds:
        before = explained.before
        speed = float(np.median(np.abs(explained.drive.recordings.motion[:, 1])))
        force = before.base[VISCOUS]
        sentences.append(
            "Viscous and Coulomb friction cannot be distinguished at one speed. What is known is their sum at "
            f"{1e3 * speed:.4g} mm/s, {Value(force.value * speed, force.uncertainty * speed, 'N').in_words}. Record at several speeds."
        )
    elif not known[VISCOUS] and VISCOUS not in explained.dropped:
        sentences.append(
            "The viscous friction cannot be determined well here: what friction does at these speeds has several explanations, or it is "
            "small. Record at more speeds, and faster ones."
        )
    if not limits.reverses:
        recordings = explained.drive.recordings
        share = f"only {100.0 * recordings.least_way:.2g} % of the samples are travelled in the other direction"
        why = share if recordings.least_way > 0.0 else "the drive never reverses"
        sentences.append(
            "Coulomb friction and a constant load cannot be distinguished, nor friction of the two directions: "
            f"{why}. What is known is their sum in this direction. Record to and fro."
        )
    return tuple(sentences)
