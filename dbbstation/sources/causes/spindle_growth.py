"""Thermal growth of the spindle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
    CForm,
    Effect,
    Motion,
    Owner,
    Parameter,
    Texts,
)
from dbbstation.sources.laws.temperature import (
    EQUATION,
    LOGGED_EQUATION,
    MACHINE,
    ORIGIN,
    FollowsTemperature,
    InTwoStages,
    WarmsUp,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

BEGUN_PERCENT = (-100.0, 0.0, 40.0)
"""Tried initial states [%]: a warm start that cools, a cold start, and ten minutes of earlier work at a time constant of half an hour."""

_OUT_OF_THE_SPINDLE = np.array([0.0, 0.0, -1.0])
"""Direction of the tool tip's motion, platform frame: away from the platform above it [1]."""


class SpindleGrowth(WarmsUp):
    """The tool tip moves along the spindle by g(t) of `laws.temperature` plus earlier growth.

    Earlier growth is a share b of the remaining growth a; a warm spindle that cools has b = -1. Upright level circles
    do not show it; tilted circles are shifted by (g + b a) sin(tilt).
    """

    name = "spindle-growth"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    growth = Parameter("growth_um", "µm", 10.0, "way of the tool tip out of the spindle, from the first sample on")
    usual_s = 1800.0
    texts = Texts(
        what="The spindle and its nose warm up and push the tool out of the platform. The growth given is counted from "
        "the first sample of the session; begun says how much of it was there already, against the cold spindle.",
        shows="Tilted circles wander sideways in the direction that the tool points to, upright ones stay; both "
        "directions drift alike.",
        confirm="Touch the ball or a tool with a dial gauge along the spindle's axis, cold, and again after the same "
        "time and speed as in the measurement.",
        cure="Measure with the spindle at rest and cool; else let it warm up at working speed first, or enter its growth "
        "as a tool length that follows the spindle's temperature.",
        equation=f"tool tip moves along -z of the platform by g(t) + begun a, g(t) = {EQUATION}; {LOGGED_EQUATION}",
        origin=f"thermal distortion caused by a rotating spindle, ISO 230-3; {ORIGIN}",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        before = "growth before the first sample, of that after it; -100 where a warm spindle cools"
        begun = Parameter("begun_percent", "percent", 40.0, before, BEGUN_PERCENT, newer=True)
        return (*super().parameters(machine), begun)

    def per_growth(self, motion: Motion, machine: Machine) -> Effect:  # noqa: ARG002
        return Effect(tool_tip_mm=MM_PER_UM * _OUT_OF_THE_SPINDLE)

    def grown(self, motion: Motion, values: Floats) -> Floats:
        growth, *_, percent = values
        return super().grown(motion, values[:-1]) + percent / 100.0 * growth

    def grown_by(self, motion: Motion, values: Floats) -> Floats:
        growth, *_, percent = values
        law = super().grown_by(motion, values[:-1])
        law[:, 0] += percent / 100.0
        return np.column_stack([law, np.full(len(law), growth / 100.0)])


class _InTwoStages(InTwoStages, cause=SpindleGrowth):
    """Growth of a part that is heated through another part."""


class _ByTemperature(FollowsTemperature, cause=SpindleGrowth):
    """The tip moves by c (T - T_0), with the machine's thermometer."""

    thermometers = (MACHINE,)
    growth = Parameter(
        "growth_um_k", "µm/K", 3.0, "way of the tool tip out of the spindle for each kelvin of the machine"
    )

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = "e->tip[2] -= 1e-3 * v[0] * warmer[thermometer[0]];"
        return CForm(body, by_pose=False, thermometers=self.thermometers)
