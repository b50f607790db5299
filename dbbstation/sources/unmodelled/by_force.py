"""A strut error of unknown cause that depends on the strut's force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.statics import GRAVITY_M_S2, platform_weight, strut_tensions
from dbbstation.sources.c_form import CForm
from dbbstation.sources.contract import SMOOTH_MM, Effect, LinearSource, Motion, Owner, Parameter
from dbbstation.sources.laws.weights import platform_masses
from dbbstation.sources.unmodelled.points import piecewise_linear, texts, values_at

if TYPE_CHECKING:
    from collections.abc import Collection

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

POINTS = 25
"""Points of the curve, from minus to plus the platform's weight."""


class UnexplainedByForce(LinearSource):
    """A strut error that is piecewise linear in the force due to the platform's weight.

    Forces follow from equilibrium at the commanded pose; beyond the weight the error is constant. A diagnosis calls the
    curve unexplained.
    """

    name = "unexplained-by-force"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    varies_with = "strut-force"
    candidate = False
    form_uncertainty = 0.0  # a curve fitted to measurements, without formula
    texts = texts("axial force", "actual minus driven length = sum over points k of v_ik hat_k(T_i)")

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        return values_at(_points_n(self.name, machine), "N")

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        points = _points_n(self.name, machine)
        weight = platform_weight(motion.frames(machine), platform_masses(self.name, machine))
        return piecewise_linear(points, strut_tensions(motion.struts(machine), weight))

    def c_form(self, machine: Machine, values: Floats, thermometers: Collection[str] = ()) -> CForm:  # noqa: ARG002
        body = """double load[6] = {0.0}, t[6];
platform_load(at, load);
tensions(at, load, t);
EACH e->strut[i] += 1e-3 * curve(v + points * i, points, -WEIGHT, WEIGHT, t[i]);"""
        return CForm(body, constants={"points": POINTS})


def _points_n(name: str, machine: Machine) -> Floats:
    weight_n = GRAVITY_M_S2 * platform_masses(name, machine).platform_kg
    return np.linspace(-weight_n, weight_n, POINTS)
