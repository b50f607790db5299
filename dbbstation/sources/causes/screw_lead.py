"""Lead error of the struts' screws."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.sources.contract import (
    MM_PER_UM_M,
    SMOOTH_MM,
    CForm,
    Effect,
    LinearSource,
    Motion,
    Owner,
    Texts,
    of_each_strut,
    of_own_strut,
)

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Parameter


class ScrewLead(LinearSource):
    """A strut's travel error is proportional to its travel: dL_i = e_i (L_i - L_0).

    L_0 is mid-travel; the error there belongs to the reference length. 10 µm/m are 1 µm over 100 mm.
    """

    name = "screw-lead"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    varies_with = "strut-length"
    form_uncertainty = 0.02  # the lead error of a ground screw is constant to a few per cent
    texts = Texts(
        what="The lead of a strut's screw, or the scale that measures it, is not the one in the control: the strut "
        "travels too far or not far enough.",
        shows="Circles off the middle and at other heights are shifted and deformed, the same in both directions. Base "
        "joints and strut lengths can do almost all of it, so that a calibration hides it.",
        confirm="Measure the travel of that strut over its whole stroke with a laser interferometer.",
        cure="Enter the lead, or a table of screw errors, in the control.",
        equation="actual minus driven length = e_i (L_i - L_0), L_0 the middle of the travel",
        origin="travel deviation of a ball screw over its length, ISO 3408-3",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        zero = f"strut {{}} travels more than counted; zero at {_middle_mm(machine):g} mm"
        return of_each_strut("strut_{}_um_m", "µm/m", 40.0, zero)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        travel = motion.struts(machine).length_mm - _middle_mm(machine)
        return Effect(strut_mm=of_own_strut(MM_PER_UM_M * travel))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = "EACH e->strut[i] += 1e-6 * v[i] * (at->length[i] - middle);"
        return CForm(body, by_pose=False, constants={"middle": _middle_mm(machine)})


def _middle_mm(machine: Machine) -> float:
    return sum(machine.travel.strut_mm) / 2.0
