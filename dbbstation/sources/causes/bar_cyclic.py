"""Interpolation error of the bar's encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.laws.motion import reading_without_noise_mm

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

SIGNAL_PERIODS_UM = (2.0, 4.0, 8.0, 10.0, 16.0, 20.0, 40.0, 80.0, 100.0, 200.0)
"""Signal periods of commercial length encoders [µm]."""


class BarCyclic(ErrorSource):
    """The reading has a wave along the encoder, a sin(2 pi x / p) + b cos(2 pi x / p), with signal period p.

    x is the reading less the run's whole millimetre. Each session has its own phase and amplitude, because the display
    is reset. A run that sweeps less than a period is ambiguous.
    """

    name = "bar-cyclic"
    belongs_to = Owner.SESSION
    needs = frozenset({Need.READING})
    varies_with = "reading"
    form_uncertainty = 0.2  # the wave of an encoder changes along the scale
    texts = Texts(
        what="The encoder in the bar divides its signal period unevenly: its two signals differ in size, zero or phase.",
        shows="A fine ripple in the readings, quick where they change fast; the same at the same reading, wherever the "
        "circle is. A machine so good that a circle sweeps less than a signal period does not show it.",
        confirm="Move the bar slowly by some signal periods against a better length gauge; or look at its two signals on "
        "an oscilloscope: they must draw a circle about zero.",
        cure="Clean the scale and let the encoder be adjusted; else average over several circles whose readings lie "
        "differently.",
        equation="reading = distance + a sin(2 pi x / p) + b cos(2 pi x / p), x the reading within its millimetre",
        origin="interpolation error of quadrature signals, Heydemann, Applied Optics 20 (1981) 3382, to first order",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            Parameter("sine_um", "µm", 0.2, "sine of the reading's error along the encoder's scale"),
            Parameter("cosine_um", "µm", 0.2, "cosine of the reading's error along the encoder's scale"),
            Parameter(
                "signal_period_um",
                "µm",
                20.0,
                "signal period of the bar's encoder",
                grid=SIGNAL_PERIODS_UM,
                listed=True,
            ),
        )

    def shows(self, motions: Sequence[Motion], nonlinear: Sequence[float]) -> bool:
        """Return whether half of the runs sweep a signal period."""
        swept = [np.ptp(m.reading_mm[m.kept]) for m in motions if m.reading_mm is not None]
        return bool(np.median(swept) >= MM_PER_UM * nonlinear[0])

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        waves, _ = self._waves(motion, values[2])
        return Effect(reading_mm=MM_PER_UM * waves @ values[:2])

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        waves, by_period = self._waves(motion, values[2])
        sine, cosine = waves.T
        period = by_period * (values[0] * cosine - values[1] * sine)
        return Effect(reading_mm=MM_PER_UM * np.column_stack([sine, cosine, period]))

    def _waves(self, motion: Motion, period_um: float) -> tuple[Floats, Floats]:
        """Return sine and cosine, shape (n, 2) [1], and the phase's derivative by the period, shape (n,) [rad/µm]."""
        # A period of zero or less gives no wave.
        self.require(motion)
        reading = reading_without_noise_mm(motion)
        if period_um <= 0.0:
            return np.zeros((len(reading), 2)), np.zeros(len(reading))
        place_um = (reading - np.round(np.median(reading))) / MM_PER_UM
        phase_rad = 2.0 * np.pi * place_um / period_um
        return np.column_stack([np.sin(phase_rad), np.cos(phase_rad)]), -phase_rad / period_um
