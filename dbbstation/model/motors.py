"""Predict motor forces and currents along a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, Fitted, Motion
from dbbstation.sources.laws.weights import stated_loads

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.machine_model import Actual, MachineModel


@dataclass(frozen=True, eq=False)
class MotorCurrents:
    """Predicted currents of one run.

    Attributes:
        there: the actual machine along the run.
        current_a: kept rows, shape (n, 6).
    """

    model: MachineModel
    driven: Motion
    there: Actual
    current_a: Floats

    def by_parameters(self, fitted: Fitted) -> Floats | None:
        """Return currents' derivative by a source's parameters, shape (n, 6, p), kept rows."""
        kept = self.driven.kept
        if fitted.source.of_currents:
            own = fitted.source.derivative(self.driven, self.model.as_found, fitted.values).current_a
            return None if own is None else own[kept]
        if not fitted.source.loads_struts:
            return None
        by_load = self.there.derivative(fitted).load_n
        if by_load is None:
            return None
        total = np.zeros_like(by_load)
        for drive in drives(self.model):
            per_load = drive.source.current_per_load(self.driven, self.model.as_found, drive.values)
            total += 0.0 if per_load is None else per_load[:, :, None] * by_load
        return total[kept]


def motor_currents(model: MachineModel, motion: Motion) -> MotorCurrents:
    """Predict a run's currents from loads at actual poses.

    Strut masses of the machine file are ignored if a source fits them.

    Raises:
        KinematicsError: a pose is impossible or loose.
        ModelError: a source needs missing data; the machine file has no masses.
    """
    there = model.actual(motion)
    weighing = any(f.source.weighs_struts for f in model.sources)
    stated = replace(there.machine, strut_masses=None) if weighing else there.machine
    total = Effect(
        load_n=stated_loads("drive-friction", stated, there.frames, there.hexapod),
        current_a=np.zeros(STRUTS),
    )
    for fitted in model.acting(motion):
        if fitted.source.loads_struts:
            total += Effect(load_n=there.by(fitted).load_n)
    driven = replace(motion, load_n=total.load_n)
    for drive in drives(model):
        total += drive.source.effect(driven, model.as_found, drive.values)
    current = np.broadcast_to(np.asarray(total.current_a), (len(motion), STRUTS))
    return MotorCurrents(model, driven, there, current[motion.kept])


def drives(model: MachineModel) -> tuple[Fitted, ...]:
    """Return the model's sources of motor currents."""
    return tuple(f for f in model.sources if f.source.of_currents)
