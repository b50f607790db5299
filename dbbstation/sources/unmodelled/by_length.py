"""A strut error of unknown cause that depends on the strut's length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.c_form import CForm
from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter
from dbbstation.sources.unmodelled.points import piecewise_linear, texts, values_at

if TYPE_CHECKING:
    from collections.abc import Collection

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

POINTS = 25
"""Points over the whole travel of a strut: one per 45 mm on the reference machine."""


class UnexplainedByLength(LinearSource):
    """A strut error that is piecewise linear in length.

    Errors of reference lengths and joints also cause a constant and a slope; priors separate these causes. A diagnosis
    calls the curve unexplained.
    """

    name = "unexplained-by-length"
    belongs_to = Owner.MACHINE
    varies_with = "strut-length"
    candidate = False
    form_uncertainty = 0.0  # a curve fitted to measurements, without formula
    texts = texts("length", "actual minus driven length = sum over points k of v_ik hat_k(L_i)")

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        return values_at(_points_mm(machine), "mm")

    def shortest_period_mm(self, machine: Machine, values: Floats) -> float:  # noqa: ARG002
        return float(2.0 * np.diff(_points_mm(machine))[0])

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return piecewise_linear(_points_mm(machine), motion.struts(machine).length_mm)

    def c_form(self, machine: Machine, values: Floats, thermometers: Collection[str] = ()) -> CForm:  # noqa: ARG002
        body = "EACH e->strut[i] += 1e-3 * curve(v + points * i, points, low, high, at->length[i]);"
        low, high = machine.travel.strut_mm
        return CForm(body, by_pose=False, constants={"points": POINTS, "low": low, "high": high})


def _points_mm(machine: Machine) -> Floats:
    return np.linspace(*machine.travel.strut_mm, POINTS)
