"""Length of the bar."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class BarOffset(LinearSource):
    """All readings of a session exceed the true distance by a constant."""

    name = "bar-offset"
    belongs_to = Owner.SESSION
    texts = Texts(
        what="The bar was set to a length on its calibrator that is not quite the true one.",
        shows="All circles of the session are larger or smaller by the same amount.",
        confirm="Put the bar on its calibrator again at the end of the session and compare the reading.",
        cure="Calibrate the bar at the temperature of the measurement, with a calibrator of smaller uncertainty.",
        equation="reading = distance + offset",
        origin="bar calibration; the session's `calibrator_uncertainty_mm`",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (Parameter("offset_mm", "mm", 0.0005, "reading minus true distance"),)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(reading_mm=np.ones(1))

    def stated_mm(self, motion: Motion) -> Floats | None:
        return None if motion.setup is None else np.array([motion.setup.bar_uncertainty_mm])
