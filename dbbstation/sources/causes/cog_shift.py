"""Displacement of the platform's centre of gravity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.statics import GRAVITY_M_S2, Load, stretch_mm, strut_tensions
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import for_such_struts, platform_masses, strut_compliance

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class CogShift(LinearSource):
    """The weight acts at a distance d from the stated point, which adds the moment d x W [GRAV 3.2].

    d is fixed in the platform. [GRAV] identifies only its axial part, from motor currents. Circles show d times the
    struts' compliance: from the source gravity, else from the machine file.
    """

    name = "cog-shift"
    belongs_to = Owner.MACHINE
    form_uncertainty = 0.02  # weights are known to a per cent, compliance is linear
    detail_mm = SMOOTH_MM
    weighs = True
    loads_struts = True
    texts = Texts(
        what="The platform's centre of gravity is not where the machine file has it: another spindle, tool, hose or "
        "motor than the drawing's.",
        shows="Circles deformed like those of gravity, the same in both directions: a shift along the axis tells in "
        "tilted circles only, one across it in upright ones too.",
        confirm="Compare the six motor currents at rest, upright and tilted: they show the moment directly. Or take the "
        "tool out and repeat a tilted circle.",
        cure="Enter the centre of gravity in the machine file and fit gravity again; export compensated programs for "
        "the tool that is used.",
        equation="J^T dT = [0, (R d) x W]; actual minus driven length = c(L) dT",
        origin="[GRAV 3.1, 3.2], with three coordinates where the paper has the one along the axis",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        platform_masses(self.name, machine)
        counted = for_such_struts(machine)
        return tuple(
            Parameter(f"{axis}_mm", "mm", 20.0, f"centre of gravity actual minus stated, platform {axis}; {counted}")
            for axis in "xyz"
        )

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        stretch, tension = self._of_a_shift(motion, machine, values)
        return Effect(strut_mm=stretch, load_n=tension)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        each = [self._of_a_shift(motion, machine, axis) for axis in np.eye(3)]
        stretch, tensions = (np.stack(one, axis=-1) for one in zip(*each, strict=True))
        return Effect(strut_mm=stretch, load_n=tensions)

    def _of_a_shift(self, motion: Motion, machine: Machine, shift_mm: Floats) -> tuple[Floats, Floats]:
        weight_n = platform_masses(self.name, machine).platform_kg * GRAVITY_M_S2
        struts = motion.struts(machine)
        x, y, _ = (motion.frames(machine).rotation @ shift_mm).T
        moment = weight_n * np.column_stack([-y, x, np.zeros(len(x))])  # of a downward weight
        tension = strut_tensions(struts, Load(np.zeros_like(moment), moment))
        return stretch_mm(struts, strut_compliance(machine), tension), tension

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm(
            """double load[6] = {0.0}, t[6];
load[3] = -WEIGHT * dot(at->r[1], v), load[4] = WEIGHT * dot(at->r[0], v);
tensions(at, load, t);
EACH e->strut[i] += stretch(at, i, COMPLIANCE) * t[i];"""
        )
