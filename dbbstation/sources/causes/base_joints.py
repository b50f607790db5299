"""Position errors of the base joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Texts, of_each_joint

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter

USUAL_MM = 0.2
"""Usual error of a joint's coordinate if the machine file states no tolerance [mm]."""


class BaseJoints(LinearSource):
    """Base joints are displaced from design by dQ_i, i = 1 to 6, three coordinates each [CAL II-C 2]."""

    name = "base-joints"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    texts = Texts(
        what="The centres of the base joints are not where the controller has them.",
        shows="Circles shifted, deformed and differently so at every place and tilt; the same in both directions.",
        confirm="Measure the joints' centres with a coordinate measuring machine or a laser tracker.",
        cure="Enter the identified joints in the control, or export compensated programs.",
        equation="Q_i = nominal Q_i + dQ_i",
        origin="[CAL II-C 2]",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        stated = machine.joint_tolerance_mm
        return of_each_joint(stated or USUAL_MM, "base joint {} actual minus nominal {}", "XYZ", stated)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(base_joint_mm=np.eye(3 * STRUTS).reshape(STRUTS, 3, 3 * STRUTS))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm("ALL e->base[i][k] += v[3 * i + k];", by_pose=False)
