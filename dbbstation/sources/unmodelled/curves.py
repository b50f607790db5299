"""Strut errors of unknown cause: a piecewise linear curve over the strut's length or force, and a wave."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.statics import GRAVITY_M_S2, platform_weight, strut_tensions
from dbbstation.sources.contract import (
    MM_PER_UM,
    SMOOTH_MM,
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
from dbbstation.sources.laws.weights import platform_masses

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


POINTS = 25
"""Points of a curve: over the whole travel of a strut, one per 45 mm on the reference machine; or from minus to plus the
platform's weight."""

TOLERANCE_UM = 10.0
"""Prior standard deviation of a value in every fit [µm]; it keeps points without nearby readings at zero."""

PLAUSIBLE_UM = 2.0 * TOLERANCE_UM
"""Usual size [µm], so far above the tolerance that no fit counts a point bounded by the tolerance as lost."""


def values_at(points: Floats, unit: str) -> tuple[Parameter, ...]:
    """Return one parameter per strut and point, ordered by strut."""
    return tuple(
        Parameter(
            f"strut_{i + 1}_at_{number}_um",
            "µm",
            PLAUSIBLE_UM,
            f"strut {i + 1} actual minus driven length at {place:g} {unit}, cause unknown",
            tolerance=TOLERANCE_UM,
            strut=i + 1,
        )
        for i in range(STRUTS)
        for number, place in enumerate(points, start=1)
    )


def piecewise_linear(points: Floats, values: Floats) -> Effect:
    """Return the derivative by the values at the points, constant beyond the ends.

    Args:
        points: evenly spaced arguments of the curve, shape (p,).
        values: arguments of the samples, in the points' unit, shape (n, 6).
    """
    count = len(points)
    place = np.clip((values - points[0]) / (points[1] - points[0]), 0.0, count - 1.0)
    near = np.maximum(0.0, 1.0 - np.abs(place[:, :, None] - np.arange(count)))
    return Effect(strut_mm=MM_PER_UM * of_own_strut(near))


def texts(variable: str, equation: str) -> Texts:
    """Return texts for an error whose variable is known and whose cause is unknown."""
    return Texts(
        what=f"An error of the struts that follows their {variable}; its cause is unknown.",
        shows=f"What a diagnosis leaves without a name repeats at the same {variable}, in every test and direction.",
        confirm=f"Record the tests again: the curve over {variable} comes back. Look at the strut that it names.",
        cure="Find the cause. Until then a model that keeps the curve compensates it where it was measured, and nowhere "
        "else.",
        equation=equation,
        origin="no physics: a curve through what was measured",
    )


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

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = "EACH e->strut[i] += 1e-3 * curve(v + points * i, points, low, high, at->length[i]);"
        low, high = machine.travel.strut_mm
        return CForm(body, by_pose=False, constants={"points": POINTS, "low": low, "high": high})


def _points_mm(machine: Machine) -> Floats:
    return np.linspace(*machine.travel.strut_mm, POINTS)


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

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = """double load[6] = {0.0}, t[6];
platform_load(at, load);
tensions(at, load, t);
EACH e->strut[i] += 1e-3 * curve(v + points * i, points, -WEIGHT, WEIGHT, t[i]);"""
        return CForm(body, constants={"points": POINTS})


def _points_n(name: str, machine: Machine) -> Floats:
    weight_n = GRAVITY_M_S2 * platform_masses(name, machine).platform_kg
    return np.linspace(-weight_n, weight_n, POINTS)


PERIODS_MM = (5.0, 10.0, 20.0, 50.0, 100.0)


class UnexplainedWave(ErrorSource):
    """A strut error is a wave: dL_i = a_i sin(2 pi (L_i - L_0) / p_i) + b_i cos(2 pi (L_i - L_0) / p_i).

    L_0 is mid-travel. A wave with the period of the screw's lead belongs to `screw-cyclic`; p is another period. A
    diagnosis calls the wave unexplained.
    """

    name = "unexplained-wave"
    belongs_to = Owner.MACHINE
    varies_with = "strut-length"
    candidate = False
    form_uncertainty = 0.0  # a curve fitted to measurements, without formula
    texts = texts("length", "dL_i = a_i sin(2 pi (L_i - L_0) / p_i) + b_i cos(2 pi (L_i - L_0) / p_i)")

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        middle = f"counted from {sum(machine.travel.strut_mm) / 2.0:g} mm, cause unknown"
        found: list[Parameter] = []
        for i in range(STRUTS):
            for wave in ("sine", "cosine"):
                meaning = f"{wave} of strut {i + 1}, {middle}"
                name = f"strut_{i + 1}_{wave}_um"
                found += [Parameter(name, "µm", PLAUSIBLE_UM, meaning, tolerance=TOLERANCE_UM, strut=i + 1)]
            period = f"strut_{i + 1}_period_mm"
            found += [Parameter(period, "mm", 20.0, f"period of the wave of strut {i + 1}", PERIODS_MM, strut=i + 1)]
        return tuple(found)

    def shortest_period_mm(self, machine: Machine, values: Floats) -> float:  # noqa: ARG002
        by_strut = values.reshape(STRUTS, 3)
        there = (by_strut[:, :2] != 0.0).any(axis=1) & (by_strut[:, 2] != 0.0)
        return float(np.abs(by_strut[there, 2]).min(initial=SMOOTH_MM))

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        by_strut = values.reshape(STRUTS, 3)
        waves, _ = _waves(motion, machine, by_strut[:, 2])
        return Effect(strut_mm=MM_PER_UM * np.sum(waves * by_strut[:, :2], axis=-1))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        by_strut = values.reshape(STRUTS, 3)
        waves, turned_rad = _waves(motion, machine, by_strut[:, 2])
        sine, cosine = waves[:, :, 0], waves[:, :, 1]
        by_angle = by_strut[:, 0] * cosine - by_strut[:, 1] * sine
        period = np.where(by_strut[:, 2] == 0.0, np.inf, by_strut[:, 2])
        each = np.concatenate([waves, (-by_angle * turned_rad / period)[:, :, None]], axis=-1)
        return Effect(strut_mm=MM_PER_UM * of_own_strut(each))

    def c_form(self, machine: Machine, values: Floats) -> CForm:  # noqa: ARG002
        body = """EACH {
    double turn = v[3 * i + 2] ? 6.28318530717958647693 * (at->length[i] - middle) / v[3 * i + 2] : 0.0;
    e->strut[i] += 1e-3 * (v[3 * i] * sin(turn) + v[3 * i + 1] * cos(turn));
}"""
        return CForm(body, by_pose=False, constants={"middle": sum(machine.travel.strut_mm) / 2.0})


def _waves(motion: Motion, machine: Machine, period_mm: Floats) -> tuple[Floats, Floats]:
    travel = motion.struts(machine).length_mm - sum(machine.travel.strut_mm) / 2.0
    turned_rad = 2.0 * np.pi * travel / np.where(period_mm == 0.0, np.inf, period_mm)
    return np.stack([np.sin(turned_rad), np.cos(turned_rad)], axis=-1), turned_rad
