"""Results of a calibration on motor currents."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.value import Value
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.statics import GRAVITY_M_S2
from dbbstation.sources.causes.drive_friction import PER_MOTOR, of_motor
from dbbstation.sources.laws.weights import platform_masses

if TYPE_CHECKING:
    from dbbstation.calibration.currents import MotorFindings
    from dbbstation.calibration.fit.calibrate import Calibration

N_PER_KN = 1e3
MM_PER_M = 1e3


@dataclass(frozen=True)
class Motor:
    """One motor; None for undetermined numbers.

    Attributes:
        motor: 1 to 6.
        force_per_current: of the strut [N/A].
        torque_per_current: at the screw [Nm/A]; None if its lead is unknown.
    """

    motor: int
    gain_a_kn: Value | None
    coulomb_n: Value | None
    viscous_ns_mm: Value | None
    load_share_n_kn: Value | None
    asymmetry_n: Value | None
    force_per_current: Value | None
    torque_per_current: Value | None
    residual_a: float | None
    noise_a: float | None
    noise_correlation_samples: float | None
    samples: int


@dataclass(frozen=True)
class CurrentsFigures:
    """Results of all motors.

    Attributes:
        weight_taken_as_known_n: of the platform; all forces are relative to it.
        centre_of_gravity: by coordinate and channel, `circles`, `currents`, `both` [mm]; None if undetermined.
    """

    weight_taken_as_known_n: float
    motors: tuple[Motor, ...]
    centre_of_gravity: Mapping[str, Mapping[str, Value | None]]
    notes: tuple[str, ...]


def motor_currents(calibration: Calibration) -> CurrentsFigures | None:
    """Return gain, friction, noise and residual of motors, and the centre of gravity by channel.

    Without fitted currents the result is None; undetermined numbers are None.
    """
    found = calibration.currents
    if found is None:
        return None
    weight_n = platform_masses("drive-friction", calibration.layout.machine).platform_kg * GRAVITY_M_S2
    return CurrentsFigures(
        weight_taken_as_known_n=weight_n,
        motors=tuple(_motor(calibration, found, motor) for motor in range(STRUTS)),
        centre_of_gravity=_centre_of_gravity(calibration, found),
        notes=tuple(found.notes),
    )


def _fitted(calibration: Calibration, source: str) -> dict[str, tuple[float, float]]:
    sigma = np.sqrt(np.maximum(calibration.solution.variance, 0.0))
    numbers = zip(calibration.layout.names, calibration.x, sigma, strict=True)
    return {name: (float(value), float(u)) for (of, _, name), value, u in numbers if of == source}


def _motor(calibration: Calibration, found: MotorFindings, motor: int) -> Motor:
    term = next(term for term in calibration.layout.terms if term.source.of_currents)
    numbers = _fitted(calibration, term.source.name)
    units = {p.name: p.unit for p in term.parameters}
    names = {kind: of_motor(motor + 1, kind) for kind in PER_MOTOR}
    told = {kind: None if name in found.held else Value(*numbers[name], units[name]) for kind, name in names.items()}
    gain, gain_u = numbers[names[PER_MOTOR[0]]]
    force = torque = None
    if told[PER_MOTOR[0]] is not None and gain != 0.0:
        force = Value(N_PER_KN / gain, N_PER_KN * gain_u / gain**2, "N/A")
        lead = calibration.layout.machine.screw_lead_mm
        turning = None if lead is None else lead / (2.0 * math.pi * MM_PER_M)
        if turning:
            torque = Value(force.value * turning, force.uncertainty * turning, "Nm/A")
    noise = found.noise[motor]
    return Motor(
        motor=motor + 1,
        **told,
        force_per_current=force,
        torque_per_current=torque,
        residual_a=None if noise is None else found.residual_a[motor],
        noise_a=None if noise is None else found.fine_a[motor],
        noise_correlation_samples=None if noise is None else noise.correlation_samples,
        samples=found.samples[motor],
    )


def _centre_of_gravity(calibration: Calibration, found: MotorFindings) -> dict[str, dict[str, Value | None]]:
    together = _fitted(calibration, "cog-shift")
    shifts: dict[str, dict[str, Value | None]] = {}
    for name in next(iter(found.alone.values()), {}):
        alone = {channel: by_name[name] for channel, by_name in found.alone.items()}
        shifts[name] = {
            **{channel: None if number is None else Value(*number, "mm") for channel, number in alone.items()},
            "both": Value(*together[name], "mm"),
        }
    return shifts
