"""Strut elongation under the platform's weight."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.statics import platform_weight, stretch_mm, strut_tensions
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import MM_PER_N, platform_masses, strut_compliance

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Compliance, Machine

PER_KN = 1e-3


class Gravity(LinearSource):
    """Struts change length under the platform's weight: dL_i = c(L_i) T_i [GRAV eq 1, 6, 7, 8].

    Signed tensions T follow from equilibrium at the given pose and joints. Actual joints and pose change them by parts
    in a thousand, near loose poses (A = -25 degrees, Y = 100 mm) by parts in a hundred.

    c(L) = c_1000 (1 - s + s L / 1000 mm) is common to all struts, with the share s of the machine file. Circles show
    only compliance times weight: 1 % more weight equals 1 % softer struts. `_Contacts` describes joints and bearings
    that stiffen under load.
    """

    name = "gravity"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    weighs = True
    varies_with = "strut-force"
    form_uncertainty = 0.02  # struts are almost linear springs
    texts = Texts(
        what="The struts are elastic: the platform's weight pulls some of them longer and pushes others shorter.",
        shows="Circles with the spindle tilted, above all off the centre, are deformed by tens of µm, the same in both "
        "directions; upright circles in the middle hardly show it. A calibration that does not know of it "
        "hides most of it in joint positions that are wrong by tenths of a millimetre.",
        confirm="Repeat one circle at growing tilt: the deformation grows steeply with the tilt. Hang a known mass "
        "on the spindle: all of it grows by the ratio of the weights.",
        cure="Fit gravity together with the joints, never after them, and export compensated programs.",
        equation="actual minus driven length = c(L) T; J^T T = [W, r_G x W]; c(L) = c_1000 (1 - s + s L / 1000 mm); "
        "or, where contacts stiffen, less h T ln(hypot(T, 0.1 kN) / 1 kN)",
        origin="[GRAV eq 1, 6, 7, 8] with the platform's own mass, signed forces and no strut weights; contacts: a roller between "
        "flats (Johnson, Contact Mechanics, 1985, sec. 5.6)",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        platform_masses(self.name, machine)
        usual = strut_compliance(machine).at_1000mm_mm_per_n / MM_PER_N
        meaning = "elongation of a strut of 1000 mm per force that pulls it, positive"
        return (Parameter("strut_compliance_um_kn", "µm/kN", usual, meaning, positive=True),)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(strut_mm=_stretched(motion, machine)[1][:, :, None])

    def found_compliance(self, machine: Machine, values: Floats) -> Compliance | None:
        if values[0] == 0.0:
            return None
        return replace(strut_compliance(machine), at_1000mm_mm_per_n=MM_PER_N * float(values[0]))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        return CForm(
            """double load[6] = {0.0}, t[6];
platform_load(at, load);
tensions(at, load, t);
EACH e->strut[i] += stretch(at, i, 1e-6 * v[0]) * t[i];"""
        )


class _Contacts(Gravity, law="contacts", law_of=Gravity):
    """Contacts lose the compliance h per e-fold of load: c(L) T - h T ln(hypot(T, 0.1 kN) / 1 kN).

    Rollers follow this law; a power law of the load is similar.
    """

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        (compliance,) = super().parameters(machine)
        meaning = "compliance that a strut loses as its force grows 2.72 times; the other value is that at 1 kN"
        return (compliance, Parameter("stiffening_um_kn", "µm/kN", STIFFENING * compliance.plausible, meaning))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        tension, stretch = _stretched(motion, machine)
        return Effect(strut_mm=np.stack([stretch, -MM_PER_N * tension * _folds(tension, ACROSS_N)], axis=2))

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return effects of another transverse load, and of contact compliance that grows with strut length."""
        tension, stretch = _stretched(motion, machine)
        own, folds = MM_PER_N * tension, _folds(tension, ACROSS_N)
        changes = [own * (folds - _folds(tension, 3.0 * ACROSS_N)), (own - stretch) * folds]
        return Effect(strut_mm=values[1] * np.stack(changes, axis=2))

    def c_form(self, machine: Machine, values: Floats) -> CForm:
        springs = super().c_form(machine, values).body
        return CForm(f"{springs}\nEACH e->strut[i] -= 1e-6 * v[1] * t[i] * log(1e-3 * hypot(t[i], {ACROSS_N}));")


def _folds(tension: Floats, across_n: float) -> Floats:
    return np.log(PER_KN * np.hypot(tension, across_n))


ACROSS_N = 100.0
"""Transverse load on a strut's joints: half the weight of a strut of 20 kg [N]."""

STIFFENING = 0.1
"""Usual relative loss of compliance per e-fold of load: rollers deflect by about the 0.9th power of load."""


def _stretched(motion: Motion, machine: Machine) -> tuple[Floats, Floats]:
    masses = platform_masses(Gravity.name, machine)
    frames, struts = motion.frames(machine), motion.struts(machine)
    tension = strut_tensions(struts, platform_weight(frames, masses))
    unit = replace(strut_compliance(machine), at_1000mm_mm_per_n=MM_PER_N)
    return tension, stretch_mm(struts, unit, tension)
