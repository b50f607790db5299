"""A periodic strut error of unknown cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.c_form import CForm
from dbbstation.sources.contract import MM_PER_UM, SMOOTH_MM, Effect, ErrorSource, Motion, Owner, Parameter
from dbbstation.sources.unmodelled.curves import PLAUSIBLE_UM, TOLERANCE_UM, texts

if TYPE_CHECKING:
    from collections.abc import Collection

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

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
        own = each[:, :, None, :] * np.eye(STRUTS)[:, :, None]
        return Effect(strut_mm=MM_PER_UM * own.reshape(len(motion), STRUTS, 3 * STRUTS))

    def c_form(self, machine: Machine, values: Floats, thermometers: Collection[str] = ()) -> CForm:  # noqa: ARG002
        body = """EACH {
    double turn = v[3 * i + 2] ? 6.28318530717958647693 * (at->length[i] - middle) / v[3 * i + 2] : 0.0;
    e->strut[i] += 1e-3 * (v[3 * i] * sin(turn) + v[3 * i + 1] * cos(turn));
}"""
        return CForm(body, by_pose=False, constants={"middle": sum(machine.travel.strut_mm) / 2.0})


def _waves(motion: Motion, machine: Machine, period_mm: Floats) -> tuple[Floats, Floats]:
    travel = motion.struts(machine).length_mm - sum(machine.travel.strut_mm) / 2.0
    turned_rad = 2.0 * np.pi * travel / np.where(period_mm == 0.0, np.inf, period_mm)
    return np.stack([np.sin(turned_rad), np.cos(turned_rad)], axis=-1), turned_rad
