"""Quadratic scale error of the bar's encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, LinearSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.laws.motion import reading_without_noise_mm

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

REACH_MM = 0.1
"""Encoder travel at which the error is stated [mm]."""


class BarScale(LinearSource):
    """The reading error grows with the square of the travel from the nominal length.

    Travel counts from the run's whole millimetre. The proportional part is `bar-gain`. Deviations of a few micrometres
    do not show the curvature.
    """

    name = "bar-scale"
    belongs_to = Owner.INSTRUMENT
    needs = frozenset({Need.READING})
    varies_with = "reading"
    form_uncertainty = 0.1  # a scale is bent in more ways than a parabola
    texts = Texts(
        what="The encoder in the bar does not show the same millimetre everywhere: its error is curved along its way.",
        shows="Readings far from the bar's nominal length are off, the same at the same reading wherever the circle is: the more, "
        "the larger the circle's deviations are.",
        confirm="Move the bar by tenths of a millimetre on both sides of its nominal length against a better length gauge.",
        cure="Let the encoder be calibrated over its way, not in one point; measure with a bar whose readings stay near its nominal "
        "length, as they do once the machine is calibrated.",
        equation="reading = distance + b (x/r)², x: reading less its whole millimetre, r = 0.1 mm",
        origin="calibration curve of a length encoder to second order",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            Parameter(
                "curved_um", "µm", 0.5, "error of the reading 0.1 mm away from the nominal length, on either side"
            ),
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        self.require(motion)
        reading = reading_without_noise_mm(motion)
        way = (reading - np.round(np.median(reading))) / REACH_MM
        return Effect(reading_mm=MM_PER_UM * way[:, None] ** 2)
