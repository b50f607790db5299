"""Errors that repeat with each turn of a strut's screw."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import (
    MM_PER_UM,
    CForm,
    Effect,
    ErrorSource,
    LinearSource,
    Motion,
    Owner,
    Parameter,
    Texts,
    of_own_strut,
)
from dbbstation.sources.laws.weights import screw_lead_mm

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class ScrewCyclic(LinearSource):
    """A strut's error has one wave per screw turn of lead p: dL = a sin(2 pi L / p) + b cos(2 pi L / p).

    `_TwoHarmonics` adds a second harmonic, `_AlongTheScrew` an amplitude that changes as a bent screw extends. The
    phase counts from length zero, so only the amplitude is meaningful.
    """

    name = "screw-cyclic"
    belongs_to = Owner.MACHINE
    varies_with = "strut-length"
    harmonics: ClassVar[tuple[int, ...]] = (1,)
    form_uncertainty = 0.1  # the error of one turn differs along the screw
    texts = Texts(
        what="The screw wobbles in its bearing, or its encoder sits off the axis: the error repeats with every turn.",
        shows="A fine ripple on the circle, quick where that strut moves fast and slow where it turns round; the same at "
        "the same strut lengths in both directions.",
        confirm="Move the strut slowly over three turns of its screw against a laser interferometer or a linear scale.",
        cure="Centre the encoder, or seat the screw's bearing anew; else enter a table of screw errors as fine as a "
        "quarter of the lead.",
        equation="actual minus driven length = a_i sin(2 pi L_i / p) + b_i cos(2 pi L_i / p), p the screw's lead; or with the same "
        "for p / 2, and both times 1 + g (L_i - L_0), L_0 the middle of the travel",
        origin="once-per-turn travel variation of a ball screw, v_2pi of ISO 3408-3; eccentricity of a rotary encoder",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        lead_mm = screw_lead_mm(self.name, machine)
        return tuple(
            Parameter(
                f"strut_{i + 1}_{wave}{'' if order == 1 else f'_{order}'}_um",
                "µm",
                USUAL_UM / order,
                f"{wave} of strut {i + 1} with period {lead_mm / order:g} mm",
                strut=i + 1,
            )
            for order in self.harmonics
            for i in range(STRUTS)
            for wave in ("sine", "cosine")
        )

    def shortest_period_mm(self, machine: Machine, values: Floats) -> float:  # noqa: ARG002
        return screw_lead_mm(self.name, machine) / max(self.harmonics)

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(strut_mm=self.waves_mm(motion, machine))

    def waves_mm(self, motion: Motion, machine: Machine) -> Floats:
        turned_rad = 2.0 * np.pi / screw_lead_mm(self.name, machine) * motion.struts(machine).length_mm
        waves = [np.stack([np.sin(k * turned_rad), np.cos(k * turned_rad)], axis=-1) for k in self.harmonics]
        return np.asarray(MM_PER_UM * np.concatenate([of_own_strut(wave) for wave in waves], axis=2), dtype=np.float64)

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = """for (int order = 1; order <= harmonics; order++) EACH {
    double turn = 6.28318530717958647693 * order / lead * at->length[i];
    const double *wave = v + 12 * (order - 1) + 2 * i;
    e->strut[i] += 1e-3 * (wave[0] * sin(turn) + wave[1] * cos(turn)) * (1.0 + growth * (at->length[i] - middle));
}"""
        constants = {"lead": screw_lead_mm(self.name, machine), "harmonics": max(self.harmonics)}
        return CForm(body, by_pose=False, constants={**constants, "growth": 0.0, "middle": 0.0})


USUAL_UM = 2.0
"""Usual size of the first harmonic [µm]; sizes fall with the order."""


class _TwoHarmonics(ScrewCyclic, law="two harmonics", law_of=ScrewCyclic):
    """A wave with second harmonic."""

    harmonics = (1, 2)


GROWTHS_PERCENT_M = (-200.0, 0.0, 200.0)
"""Tried changes of the amplitude along the screw, relative to mid-travel [percent/m]: from half to twice over a usual
travel."""


class _AlongTheScrew(ErrorSource, law="along the screw", law_of=ScrewCyclic, extends=_TwoHarmonics):
    """Two harmonics whose amplitude changes along the screw, equally on all struts."""

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        meaning = "change of the amplitude along the screw, of that at the middle of the travel"
        growth = Parameter("growth_percent_m", "percent/m", 200.0, meaning, GROWTHS_PERCENT_M)
        return (*_TwoHarmonics().parameters(machine), growth)

    def shortest_period_mm(self, machine: Machine, values: Floats) -> float:
        return _TwoHarmonics().shortest_period_mm(machine, values)

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        waves = _TwoHarmonics().waves_mm(motion, machine)
        return Effect(strut_mm=(waves @ values[:-1]) * (1.0 + values[-1] * _out(motion, machine)))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        waves, out = _TwoHarmonics().waves_mm(motion, machine), _out(motion, machine)
        by_growth = out * (waves @ values[:-1])
        return Effect(
            strut_mm=np.concatenate([waves * (1.0 + values[-1] * out)[:, :, None], by_growth[:, :, None]], axis=2)
        )

    def c_form(self, machine: Machine, values: Floats) -> CForm:
        form = _TwoHarmonics().c_form(machine, values)
        grown = {"growth": 1e-5 * float(values[-1]), "middle": sum(machine.travel.strut_mm) / 2.0}
        return replace(form, constants={**form.constants, **grown})


def _out(motion: Motion, machine: Machine) -> Floats:
    """Return each strut's extension beyond mid-travel, shape (n, 6) [100 m], to be multiplied by percent/m."""
    return 1e-5 * (motion.struts(machine).length_mm - sum(machine.travel.strut_mm) / 2.0)
