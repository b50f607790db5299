"""A force periodic along the travel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.contract import DriveForm, DriveSource, Parameter, Scale, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals


class Cogging(DriveSource):
    """Force periodic in position: F = c cos(2 pi x / p) + s sin(2 pi x / p)."""

    name = "cogging"
    varies_with = "position wave"
    form_uncertainty = 0.05  # magnets and slots differ from pole to pole
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

    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        size = 0.1 * scale.force_n
        cosine = Parameter("cosine_n", "N", size, "amplitude of the cosine, position zero is where it is greatest")
        sine = Parameter("sine_n", "N", size, "amplitude of the sine")
        found = []
        for wave in scale.waves_per_m:
            # A wave wrong by a quarter period over the travel does not fit; three points enclose the best one.
            grid = tuple(1e3 / (wave + step / scale.travel_m) for step in (0.15, 0.0, -0.15))
            period = Parameter("period_mm", "mm", 1e3 / wave, "travel of one wave", grid)
            label = f"{1e3 / wave:.3g} mm"
            found.append(DriveForm((cosine, sine, period), _columns, label, scale.waves_tried))
        return tuple(found)


def _columns(signals: Signals, period_mm: tuple[float, ...]) -> Floats:
    angle = 2.0 * np.pi * 1e3 * signals.position_m / period_mm[0]
    return np.column_stack([np.cos(angle), np.sin(angle)])
