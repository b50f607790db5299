"""Struts stretched and compressed by the platform's weight."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.machine.statics import platform_weight, stretch_mm, strut_tensions
from dbbstation.sources.c_form import CForm
from dbbstation.sources.contract import SMOOTH_MM, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import MM_PER_N, platform_masses, strut_compliance

if TYPE_CHECKING:
    from collections.abc import Collection

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Compliance, Machine


class Gravity(LinearSource):
    """Struts change length under the platform's weight: dL_i = c(L_i) T_i [GRAV eq 1, 6, 7, 8].

    Tensions T follow from equilibrium at the given pose and joints. The actual ones differ by parts in a thousand, near
    loose poses (A = -25 degrees, Y = 100 mm) by parts in a hundred. Tensions are signed.

    c(L) = c_1000 (1 - s + s L / 1000 mm) is common to all struts; the share s is the machine file's. Circles show only
    compliance times weight: 1 % more weight reads as 1 % softer struts.
    """

    name = "gravity"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    weighs = True
    varies_with = "strut-force"
    form_uncertainty = 0.02  # struts are nearly linear springs
    texts = Texts(
        what="The struts are elastic: the platform's weight pulls some of them longer and pushes others shorter.",
        shows="Circles with the spindle tilted, above all off the centre, are deformed by tens of µm, the same in both "
        "directions; upright circles in the middle hardly show it. A calibration that does not know of it "
        "hides most of it in joint positions that are wrong by tenths of a millimetre.",
        confirm="Repeat one circle at growing tilt: the deformation grows steeply with the tilt. Hang a known mass "
        "on the spindle: all of it grows by the ratio of the weights.",
        cure="Fit gravity together with the joints, never after them, and export compensated programs.",
        equation="actual minus driven length = c(L) T; J^T T = [W, r_G x W]; c(L) = c_1000 (1 - s + s L / 1000 mm)",
        origin="[GRAV eq 1, 6, 7, 8] with the platform's own mass, signed forces and no strut weights",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        """Return one compliance, of the design's size if stated.

        Raises:
            ModelError: the machine file has no masses.
        """
        platform_masses(self.name, machine)
        usual = strut_compliance(machine).at_1000mm_mm_per_n / MM_PER_N
        meaning = "elongation of a strut of 1000 mm per force that pulls it, positive"
        return (Parameter("strut_compliance_um_kn", "µm/kN", usual, meaning, positive=True),)

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """Elongation of each strut per compliance.

        Raises:
            ModelError: the machine file has no masses.
            KinematicsError: a pose where the struts cannot hold the platform.
        """
        masses = platform_masses(self.name, machine)
        frames, struts = motion.frames(machine), motion.struts(machine)
        tension = strut_tensions(struts, platform_weight(frames, masses))
        unit = replace(strut_compliance(machine), at_1000mm_mm_per_n=MM_PER_N)
        return Effect(strut_mm=stretch_mm(struts, unit, tension)[:, :, None])

    def found_compliance(self, machine: Machine, values: NDArray[np.float64]) -> Compliance | None:
        """Return the fitted compliance; None while zero."""
        if values[0] == 0.0:
            return None
        return replace(strut_compliance(machine), at_1000mm_mm_per_n=MM_PER_N * float(values[0]))

    def c_form(self, machine: Machine, values: NDArray[np.float64], thermometers: Collection[str] = ()) -> CForm:  # noqa: ARG002
        return CForm(
            """double load[6] = {0.0}, t[6];
platform_load(at, load);
tensions(at, load, t);
EACH e->strut[i] += stretch(at, i, 1e-6 * v[0]) * t[i];"""
        )
