"""Thermal growth of the base plate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.sources.contract import (
    MM_PER_UM_M,
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
    STEEL_UM_M_K,
    FollowsTemperature,
    InTwoStages,
    WarmsUp,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class ThermalFrame(WarmsUp):
    """Base joints move from the plate's centre: dQ_i = Q_i g(t), g of `laws.temperature`.

    The plate's temperature is uniform, and it is fixed at the machine frame's origin; another fixed point only shifts
    it. Growth counts from the session's first sample.
    """

    name = "thermal-frame"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    growth = Parameter("growth_um_m", "µm/m", 15.0, "growth of the base from the first sample to the end of warm-up")
    usual_s = 7200.0
    texts = Texts(
        what="The base plate that carries the struts warms up while the machine works, or with the shop, and grows. The "
        "growth given is counted from the first sample of the session.",
        shows="The same circle, repeated, comes out higher or lower and of another size than an hour before; both "
        "directions drift alike. Growing struts look almost the same.",
        confirm="Log the temperature of the base plate: about 1 K for each 11 µm/m of steel. Measure one circle every "
        "half hour over a morning.",
        cure="Let machine and shop come to rest before measuring; keep the sun and warm air off the frame; repeat early "
        "tests at the end, so that the drift does not mix with the height of the ball.",
        equation=f"dQ_i = Q_i g(t), g = {EQUATION}; {LOGGED_EQUATION}",
        origin=ORIGIN,
    )

    def per_growth(self, motion: Motion, machine: Machine) -> Effect:  # noqa: ARG002
        return Effect(base_joint_mm=MM_PER_UM_M * machine.hexapod.base_joints_mm)


class _InTwoStages(InTwoStages, cause=ThermalFrame):
    """Growth of a part that is heated through another part."""


class _ByTemperature(FollowsTemperature, cause=ThermalFrame):
    """dQ_i = Q_i c (T - T_0)."""

    thermometers = (MACHINE,)
    growth = Parameter(
        "growth_um_m_k", "µm/(m K)", STEEL_UM_M_K, "growth of the base for each kelvin that it is warmer"
    )

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = "ALL e->base[i][k] += 1e-6 * v[0] * warmer[thermometer[0]] * Q[i][k];"
        return CForm(body, by_pose=False, thermometers=self.thermometers)
