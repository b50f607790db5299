"""Error source: struts stretched and compressed by the platform's weight."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.machine.statics import platform_weight, stretch_mm, strut_tensions
from dbbstation.sources.contract import SMOOTH_MM, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import MM_PER_N, platform_masses, strut_compliance

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Compliance, Machine


class Gravity(LinearSource):
    """Struts under the platform's weight are longer or shorter than driven: dL_i = c(L_i) T_i [GRAV eq 1, 6, 7, 8].

    The tensions T follow from the equilibrium of the platform at the pose and the joints given. A model gives those that
    the machine really has: that it hangs a little lower and joints sit a little elsewhere changes the forces by parts in
    a thousand, and close to poses where the struts hardly hold it by parts in a hundred (A = -25 degrees, Y = 100 mm).
    Tensions are signed: the same strut is pulled at one side of a tilted circle and pushed at the other.
    The compliance c(L) = c_1000 (1 - s + s L / 1000 mm) is one number for all struts; the share s that grows with
    length is the machine file's. Circles show the product of compliance and weight only: a platform 1 % heavier than
    the machine file says reads as struts 1 % softer.
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
        """One compliance; its usual size is the design's where the machine file has it.

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
        """Return the fitted compliance; none while it is zero, where a fit begins."""
        if values[0] == 0.0:
            return None
        return replace(strut_compliance(machine), at_1000mm_mm_per_n=MM_PER_N * float(values[0]))
