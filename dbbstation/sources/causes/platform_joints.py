"""Position errors of the platform joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Texts, of_each_joint

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter


class PlatformJoints(LinearSource):
    """Platform joints are displaced from design by dP_i, i = 1 to 6, three coordinates each.

    [CAL II-C] omits them. If lengths and base joints are fitted, upright circles do not show them. Tilted circles show
    only the rotation of a shift relative to a base joint's shift.
    """

    name = "platform-joints"
    belongs_to = Owner.MACHINE
    form_uncertainty = 0.0  # a rigid shift is exact
    detail_mm = SMOOTH_MM
    texts = Texts(
        what="The centres of the platform joints are not where the controller has them, seen from the tool tip.",
        shows="Upright circles show nothing that base joints and strut lengths could not do as well. The spindle tilted, "
        "circles are shifted and a little deformed, the same in both directions.",
        confirm="Measure the joints' centres on the platform with a coordinate measuring machine, the tool's length with "
        "a setting gauge: all six joints wrong by the same amount are a tool that is longer or set aside.",
        cure="Enter the measured joints in the control; circles tell only part of them.",
        equation="P_i = nominal P_i + dP_i; the strut feels -u_i (R dP_i)",
        origin="[CAL eq 1] differentiated by the platform joints, which [CAL II-C] takes as known",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        usual = machine.joint_tolerance_mm or 0.2
        return of_each_joint(usual, "platform joint {} actual minus nominal, platform {}")

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(platform_joint_mm=np.eye(3 * STRUTS).reshape(STRUTS, 3, 3 * STRUTS))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm("ALL e->platform[i][k] += v[3 * i + k];", by_pose=False)
