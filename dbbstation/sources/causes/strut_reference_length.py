"""Errors of the struts' reference lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Texts, of_each_strut

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter


class StrutReferenceLength(LinearSource):
    """A strut exceeds its encoder's length by a constant dL_i, i = 1 to 6 [CAL II-C 1]."""

    name = "strut-reference-length"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    texts = Texts(
        what="The length of a strut at its reference mark is not the one the controller assumes.",
        shows="Circles shifted and deformed, more so away from the middle; the same in both directions.",
        confirm="Reference the struts again and repeat a circle: the error stays. Exchange two motors: it moves.",
        cure="Enter the identified lengths as reference-length errors in the control, or export compensated programs.",
        equation="L_i = driven length + dL_i",
        origin="[CAL II-C 1]",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return of_each_strut("strut_{}_mm", "mm", 0.2, "strut {} actual minus driven length")

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(strut_mm=np.eye(STRUTS))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm("EACH e->strut[i] += v[i];", by_pose=False)
