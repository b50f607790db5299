"""Cause: a force that repeats along the travel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveSource, Form, Parameter, Texts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals

PERIODS_IN_TRAVEL = 3.0
"""Longest period that is looked for, as a share of the travel: what repeats less often is no wave."""

STEP = 0.25
"""Of the waves that are looked for, in periods over the travel."""

MOST_WAVES = 4000
STRONGEST = 3
"""Waves that are kept as forms."""

_AT_ONCE = 200


class Cogging(DriveSource):
    """Force with a period in position: F = c cos(2 pi x / p) + s sin(2 pi x / p)."""

    name = "cogging"
    varies_with = "position wave"
    texts = Texts(
        what="The motor's torque ripples with the angle (magnets, commutation), or the screw does once per turn or per "
        "ball that passes.",
        shows="A wave of the force over position that is the same forwards and backwards, at every speed.",
        confirm="Travel slowly at constant speed both ways: the waves stand at the same positions. Compare the period "
        "with the screw's lead, and with the lead divided by the motor's poles or slots.",
        cure="Ripple compensation of the drive; a concentric coupling; otherwise enter the wave as a feed-forward over "
        "position.",
        equation="F = c cos(2 pi x / p) + s sin(2 pi x / p)",
        origin="Holtz and Springob, Identification and compensation of torque ripple in high-precision permanent "
        "magnet motor drives, IEEE Trans. Ind. Electron. 43 (1996) 309",
    )

    def forms(self, signals: Signals, residual_n: NDArray[np.float64]) -> tuple[Form, ...]:
        """Cosine and sine at the periods that the residual follows best."""
        size = 0.1 * signals.scale.force_n
        cosine = Parameter("cosine_n", "N", size, "amplitude of the cosine, position zero is where it is greatest")
        sine = Parameter("sine_n", "N", size, "amplitude of the sine")
        travel = signals.scale.travel_m
        period = Parameter("period_mm", "mm", 1e3 * travel / 10.0, "travel of one wave")
        return tuple(
            Form((cosine, sine), _columns, period, 1e3 / wave, 1.0 + STEP / (wave * travel))
            for wave in _strongest(signals, residual_n)
        )


def _columns(signals: Signals, period_mm: float) -> NDArray[np.float64]:
    angle = 2.0 * np.pi * 1e3 * signals.position_m / period_mm
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _strongest(signals: Signals, residual_n: NDArray[np.float64]) -> NDArray[np.float64]:
    """Waves that a residual follows best [1/m]; shorter ones than half the filter's reach at full speed are unseen."""
    travel, position = signals.scale.travel_m, signals.position_m[signals.kept]
    speed = float(np.median(np.abs(signals.speed_m_s[signals.kept])))
    highest = 0.5 * signals.cutoff_hz / speed * travel
    periods = np.arange(PERIODS_IN_TRAVEL, highest, STEP)[:MOST_WAVES]
    if len(periods) < _AT_ONCE // 50:
        return np.zeros(0)
    waves = periods / travel
    power = np.concatenate(
        [
            np.abs(np.exp(2j * np.pi * np.outer(waves[k : k + _AT_ONCE], position)) @ residual_n)
            for k in range(0, len(waves), _AT_ONCE)
        ]
    )
    peaks = np.flatnonzero((power >= np.roll(power, 1)) & (power >= np.roll(power, -1)))
    return waves[peaks[np.argsort(-power[peaks])][:STRONGEST]]
