"""Cause: force and position that were not sampled at the same time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveSource, Form, Parameter, Texts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals


class TimeSkew(DriveSource):
    """A force channel that is late by d: F(t) = F_true(t - d), to first order F_true - d dF/dt."""

    name = "time-skew"
    varies_with = "rate of force"
    texts = Texts(
        what="The force channel is late or early against the position: filters, bus cycles, the current loop.",
        shows="Peaks where the force changes quickly, at every start, stop and reversal, of one sign where it rises and "
        "of the other where it falls.",
        confirm="Read delay and filter of both channels out of the drive's manual, or shake the drive and look at both "
        "on an oscilloscope.",
        cure="Use channels of one clock, switch filters off, or shift one channel by the delay.",
        equation="F = -d dF/dt",
        origin="Taylor's series to first order; delays in identification: Ljung, System Identification (1999), sec. 14",
    )

    def forms(self, signals: Signals, residual_n: NDArray[np.float64]) -> tuple[Form, ...]:  # noqa: ARG002
        """One amplitude."""
        size = Parameter("delay_ms", "ms", 1e3 * 0.05 / signals.cutoff_hz, "of the force; negative: it is early")
        return (Form((size,), _columns),)


def _columns(signals: Signals, _: float) -> NDArray[np.float64]:
    # The low-pass of the comparison bounds what the difference makes of noise.
    return -1e-3 * np.gradient(signals.force_n, 1.0 / signals.rate_hz)[:, None]
