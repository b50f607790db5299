"""Error source: the bar warms up while it measures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.warm_up import grown_by, time_constant, warmed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3


class BarDrift(ErrorSource):
    """The bar's reading drifts as its body takes the temperature of hand, machine and air: a (1 - exp(-t / tau)).

    Counted from the session's first sample, where the drift is zero by definition: what the bar was off then is its
    offset. Sessions with the same bar share the drift, as they begin with the same handling.
    """

    name = "bar-drift"
    belongs_to = Owner.INSTRUMENT
    needs = frozenset({Need.TIME})
    varies_with = "time"
    texts = Texts(
        what="The bar itself changes its length while it warms up or cools down after having been handled. The drift "
        "given is counted from the first sample of the session.",
        shows="Every circle is a little larger (or smaller) than the one before it, wherever it is and however the "
        "spindle is tilted, quickly at first and then ever more slowly. Nothing is shifted or deformed.",
        confirm="Put the bar on its calibrator before, during and after the session and compare the readings; a bar of "
        "steel of 150 mm reads 1.6 µm more or less per kelvin.",
        cure="Lay bar and calibrator on the machine table an hour before; touch the bar with gloves only; put it on the "
        "calibrator between the tests.",
        equation="reading = distance + a (1 - exp(-t / tau)), t since the session's first sample",
        origin="linear expansion and the first-order warm-up of a small body",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        """Drift in the end and time constant."""
        return (
            Parameter(
                "drift_um", "µm", 2.0, "reading minus true distance, from the first sample to the end of warm-up"
            ),
            time_constant(1800.0, "the drift"),
        )

    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """Drift of the reading.

        Raises:
            ModelError: the motion has no time.
        """
        return Effect(reading_mm=MM_PER_UM * values[0] * warmed(self._time_s(motion), values[1]))

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """By the drift and by the time constant.

        Raises:
            ModelError: the motion has no time.
        """
        return Effect(reading_mm=MM_PER_UM * grown_by(self._time_s(motion), *values))

    def _time_s(self, motion: Motion) -> NDArray[np.float64]:
        self.require(motion)
        return np.asarray(motion.time_s)
