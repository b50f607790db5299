"""Thermal growth of struts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    MM_PER_UM_M,
    SMOOTH_MM,
    CForm,
    Effect,
    Motion,
    Need,
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


class ThermalStruts(WarmsUp):
    """All struts grow in proportion to length: dL_i = L_i g(t), g of `laws.temperature`.

    Growth counts from the session's first sample; earlier growth is part of the reference lengths. Cold and warm starts
    therefore have different values. A prediction assumes the start of the fitted sessions.
    """

    name = "thermal-struts"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.TIME})
    growth = Parameter("growth_um_m", "µm/m", 30.0, "growth of all struts from the first sample to the end of warm-up")
    usual_s = 3600.0
    texts = Texts(
        what="The struts' screws warm up while the machine works and grow, quickly at first and then ever more slowly. "
        "The growth given is counted from the first sample of the session.",
        shows="The same circle, repeated, comes out higher or lower, shifted and of another size than an hour before; "
        "both directions drift alike.",
        confirm="Repeat an early test at the end of the session, or measure one circle every ten minutes from a cold "
        "start. A thermometer on a strut shows about 1 K for each 11 µm/m of steel.",
        cure="Let the machine warm up with a movement like that of the measurement before it starts; repeat early "
        "tests at the end, so that the drift does not mix with the height of the ball.",
        equation=f"actual minus driven length = L_i g(t), g = {EQUATION}; {LOGGED_EQUATION}",
        origin=ORIGIN,
    )

    def per_growth(self, motion: Motion, machine: Machine) -> Effect:
        return Effect(strut_mm=_per_growth_mm(motion, machine))


class _InTwoStages(InTwoStages, cause=ThermalStruts):
    """Growth of a part that is heated through another part."""


class _ByTemperature(FollowsTemperature, cause=ThermalStruts):
    """dL_i = L_i c (T_i - T_i0), by each strut's thermometer or the machine's."""

    thermometers = (tuple(f"strut{k + 1}" for k in range(STRUTS)), MACHINE)
    growth = Parameter("growth_um_m_k", "µm/(m K)", STEEL_UM_M_K, "growth of a strut for each kelvin that it is warmer")

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(strut_mm=(self.warmer_k(motion) * _per_growth_mm(motion, machine))[:, :, None])

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = "EACH e->strut[i] += 1e-6 * v[0] * warmer[thermometer[i]] * at->length[i];"
        each = tuple(columns if len(columns) == STRUTS else columns * STRUTS for columns in self.thermometers)
        return CForm(body, by_pose=False, thermometers=each)


def _per_growth_mm(motion: Motion, machine: Machine) -> Floats:
    return MM_PER_UM_M * motion.struts(machine).length_mm
