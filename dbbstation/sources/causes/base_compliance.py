"""Compliance of the frame under the base joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.statics import base_loads
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import MM_PER_N, platform_masses, stated_tensions

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class BaseCompliance(LinearSource):
    """Each base joint yields under its strut's force: dQ_i = C F_i, C = diag(h, h, v).

    The frame is an uncoupled spring under each joint, isotropic horizontally. Equal compliances act like softer struts.
    Only unequal compliances, or gravity's growth with length, separate frame and struts.
    """

    name = "base-compliance"
    belongs_to = Owner.MACHINE
    form_uncertainty = 0.05  # a frame deforms as a whole
    detail_mm = SMOOTH_MM
    weighs = True
    texts = Texts(
        what="The frame above is elastic: the base joints move with the forces of their struts.",
        shows="Circles deformed like those of gravity, the same in both directions, growing with the tilt.",
        confirm="Put a dial gauge between frame and floor beside a base joint and tilt the spindle from one side to "
        "the other: the joint moves.",
        cure="Tighten or stiffen the frame, and level the machine so that all feet carry; otherwise compensate.",
        equation="dQ_i = diag(h, h, v) F_i, F_i = T_i u_i and what the strut's own weight puts on its joint",
        origin="Hooke's law at each joint, loads from the platform's equilibrium [GRAV eq 1, 6]",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        platform_masses(self.name, machine)
        return tuple(
            Parameter(f"{way}_um_kn", "µm/kN", 3.0, f"{way} shift of a base joint per {way} force on it", positive=True)
            for way in ("horizontal", "vertical")
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        frames, struts = motion.frames(machine), motion.struts(machine)
        force = base_loads(struts, stated_tensions(self.name, machine, frames, struts), machine.strut_masses)
        horizontal, vertical = np.diag([1.0, 1.0, 0.0]), np.diag([0.0, 0.0, 1.0])
        return Effect(base_joint_mm=MM_PER_N * np.stack([force @ horizontal, force @ vertical], axis=-1))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm(
            """double load[6] = {0.0}, pull[6][3], t[6], weight = GRAVITY * (STRUT_KG[0] + STRUT_KG[1] + STRUT_KG[3]);
platform_load(at, load);
strut_load(at, STRUT_KG, load, pull);
tensions(at, load, t);
ALL e->base[i][k] += 1e-6 * v[k == 2] * (t[i] * at->unit[i][k] - pull[i][k] - (k == 2 ? weight : 0.0));"""
        )
