"""Weight of struts and motors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import StrutMasses
from dbbstation.machine.statics import motor_loads, stretch_mm, strut_tensions, transverse_load, transverse_pull
from dbbstation.sources.contract import SMOOTH_MM, CForm, Effect, LinearSource, Motion, Owner, Parameter, Texts
from dbbstation.sources.laws.weights import for_such_struts, masses_for_c, strut_compliance

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

USUAL = StrutMasses(strut_kg=25.0, motor_kg=20.0, motor_length_mm=0.0)
"""Usual masses for a machine of the PM-600's size, if the machine file states none; lengths are unknown."""


class StrutWeight(LinearSource):
    """Struts hang between base and platform, pull transversely and stretch [GRAV eq 2, 3].

    Both joints carry a strut's weight; the platform's part changes all forces. Strut, motor and screw masses are equal
    in all struts. The machine file states their lengths; parts without length are omitted. The compliance comes from
    the source gravity, else from the machine file. Motors carry the mass that moves with the strut.
    """

    name = "strut-weight"
    belongs_to = Owner.MACHINE
    form_uncertainty = 0.02  # masses are known to a few per cent
    detail_mm = SMOOTH_MM
    weighs = True
    loads_struts = True
    weighs_struts = True
    texts = Texts(
        what="Struts, screws and motors weigh something themselves: they load the platform and stretch under their own "
        "weight.",
        shows="Almost exactly as the platform's weight does; circles can hardly tell the two apart, and what gravity "
        "is fitted to takes it up.",
        confirm="Weigh a strut with its motor, or take the weights off the drawing. Motor currents at rest show the "
        "part along the strut.",
        cure="Enter the weights in the machine file; otherwise nothing: the compliance fitted for gravity then is ten "
        "or twenty percent too large and compensates nearly as well.",
        equation="f = (m_s/2 - m_m L_m/(2 L) + m_k (1 - l/(2 L))) g_across; J^T dT = [sum f, sum (R P) x f]; actual "
        "minus driven length = c(L) dT and the stretch under what hangs below each section",
        origin="[GRAV eq 2, 3, 7] with the sign of eq 2 turned, the force kept in eq 1, and the weight along the strut",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        stated = machine.strut_masses or USUAL
        counted = for_such_struts(machine)
        meanings = {
            "strut": "what lies evenly between the joints of a strut",
            "motor": "what sits behind the base joint of a strut",
            "screw": "screw of a strut that slides through the base joint",
        }
        return tuple(
            Parameter(
                f"{part}_kg",
                "kg",
                getattr(stated, f"{part}_kg") or USUAL.strut_kg,
                f"mass of {meanings[part]}; {counted}",
            )
            for part in _parts(machine)
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        struts = motion.struts(machine)
        lengths = replace(machine.strut_masses or USUAL, strut_kg=0.0, motor_kg=0.0, screw_kg=0.0)
        stretch, loads = [], []
        for part in _parts(machine):
            kilogram = replace(lengths, **{f"{part}_kg": 1.0})
            load = transverse_load(struts, transverse_pull(struts, kilogram))
            tension = strut_tensions(struts, load)
            stretch.append(stretch_mm(struts, strut_compliance(machine), tension, kilogram))
            loads.append(motor_loads(struts, tension, kilogram))
        return Effect(strut_mm=np.stack(stretch, axis=-1), load_n=np.stack(loads, axis=-1))

    def c_form(self, machine: Machine, values: Floats) -> CForm:
        lengths = replace(machine.strut_masses or USUAL, strut_kg=0.0, motor_kg=0.0, screw_kg=0.0)
        given = {f"{part}_kg": float(value) for part, value in zip(_parts(machine), values, strict=True)}
        return CForm(
            """double load[6] = {0.0}, pull[6][3], t[6];
strut_load(at, kg, load, pull);
tensions(at, load, t);
EACH {
    double own = stretch(at, i, COMPLIANCE), grows = COMPLIANCE * SHARE * at->length[i] / 1000.0;
    double hanging = kg[3] ? kg[3] * at->length[i] / kg[4] : 0.0;
    double weight = (own - grows) * (kg[3] + kg[0] / 2.0) + grows * (kg[0] + hanging) / 2.0;
    e->strut[i] += own * t[i] - GRAVITY * at->unit[i][2] * weight;
}""",
            constants={"kg": masses_for_c(replace(lengths, **given))},
        )


def _parts(machine: Machine) -> tuple[str, ...]:
    stated = machine.strut_masses or USUAL
    motor = ("motor",) if stated.motor_length_mm else ()
    screw = ("screw",) if stated.screw_length_mm else ()
    return ("strut", *motor, *screw)
