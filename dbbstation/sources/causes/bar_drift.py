"""Warm-up of the bar during measurement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.temperature import (
    EQUATION,
    LOGGED_EQUATION,
    ORIGIN,
    FollowsTemperature,
    InTwoStages,
    WarmsUp,
)

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine


class BarDrift(WarmsUp):
    """The bar's reading drifts with its body's temperature, by `laws.temperature`.

    The drift is zero at the session's first sample, because earlier errors are the bar's offset. Sessions with one bar share its values.
    """

    name = "bar-drift"
    belongs_to = Owner.INSTRUMENT
    growth = Parameter(
        "drift_um", "µm", 2.0, "reading minus true distance, from the first sample to the end of warm-up"
    )
    usual_s = 1800.0
    texts = Texts(
        what="The bar itself changes its length while it warms up or cools down after having been handled. The drift "
        "given is counted from the first sample of the session.",
        shows="Every circle is a little larger (or smaller) than the one before it, wherever it is and however the "
        "spindle is tilted, quickly at first and then ever more slowly. Nothing is shifted or deformed.",
        confirm="Put the bar on its calibrator before, during and after the session and compare the readings; a bar of "
        "steel of 150 mm reads 1.6 µm more or less per kelvin.",
        cure="Lay bar and calibrator on the machine table an hour before; touch the bar with gloves only; put it on the "
        "calibrator between the tests.",
        equation=f"reading = distance + g(t), g = {EQUATION}; {LOGGED_EQUATION}",
        origin=ORIGIN,
    )

    def per_growth(self, motion: Motion, machine: Machine) -> Effect:  # noqa: ARG002
        return Effect(reading_mm=np.array(MM_PER_UM))


class _InTwoStages(InTwoStages, cause=BarDrift):
    """Growth of a part that is heated through another part."""


class _ByTemperature(FollowsTemperature, cause=BarDrift):
    """reading = distance + c (T - T_0)."""

    thermometers = (("bar",),)
    growth = Parameter("drift_um_k", "µm/K", 1.6, "drift of the reading for each kelvin that the bar is warmer")
