"""Shortening of struts that sag under their own weight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.machine.statics import DOWN
from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
    CForm,
    Effect,
    LinearSource,
    Motion,
    Owner,
    Parameter,
    Texts,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

USUAL_UM = 0.3
"""Shortening of a level rod of 1000 mm and 25 kg with the stiffness of a steel bar of 30 mm [µm]; its sag is 0.38
mm."""


class StrutBending(LinearSource):
    """A strut sags, so the distance of its joints is less than its own length.

    A pinned strut of mass m and bending stiffness E I carries q = m g_across / L per length. Its deflection w = q x (L³
    - 2 L x² + x³) / (24 E I) shortens it by half the integral of w'²:

    shortening = 17/40320 (m g_across)² L⁵ / (E I)² = 2.487 f² / L, with the sag f in the middle.

    The parameter is the shortening of a level strut of 1000 mm. It scales with the squared cosine of inclination and
    the fifth power of length, at constant mass and stiffness. The axial force is neglected: 4 kN, a twentieth of a 30
    mm bar's buckling load, change the shortening by a tenth.
    """

    name = "strut-bending"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    varies_with = "strut-length"
    form_uncertainty = 0.05  # real ends are neither pinned nor clamped
    texts = Texts(
        what="A strut sags under its own weight; bent, it is shorter from joint to joint than its drive measures along "
        "it.",
        shows="Hardly ever: tenths of a micrometre on stiff struts, the same in both directions, most where struts are long "
        "and lie flat, and almost all of it hidden by joints and lengths.",
        confirm="Put a dial gauge on the middle of a level strut and lift it there with a spring balance by five eighths "
        "of its weight: the gauge rises by the sag f, and the shortening is 2.5 f² / L.",
        cure="Nothing, as long as the sag is below half a millimetre; thicker or lighter struts otherwise.",
        equation="actual minus driven length = -s (g_across / g)² (L / 1000 mm)⁵, s = 17/40320 (m g)² (1000 mm)⁵ / (E I)²",
        origin="second-order shortening 1/2 ∫ w'² dx of a simply supported beam under an even load, Timoshenko and Gere, "
        "Theory of Elastic Stability, chapter 1",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            Parameter("shortening_um", "µm", USUAL_UM, "shortening of a level strut of 1000 mm under its own weight"),
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        struts = motion.struts(machine)
        across_squared = 1.0 - (struts.unit @ DOWN) ** 2
        return Effect(strut_mm=-MM_PER_UM * (across_squared * (struts.length_mm / 1000.0) ** 5)[:, :, None])

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm(
            """EACH {
    double z = at->unit[i][2], m = at->length[i] / 1000.0;
    e->strut[i] -= 1e-3 * v[0] * (1.0 - z * z) * m * m * m * m * m;
}"""
        )
