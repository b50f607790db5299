"""What the motor currents of a calibration say, as plain numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.statics import GRAVITY_M_S2
from dbbstation.sources.causes.drive_friction import PER_MOTOR, of_motor
from dbbstation.sources.laws.weights import platform_masses

if TYPE_CHECKING:
    from dbbstation.calibration.currents.findings import MotorFindings
    from dbbstation.calibration.fit.calibrate import Calibration

N_PER_KN = 1e3
MM_PER_M = 1e3


def currents_summary(calibration: Calibration) -> dict[str, Any]:
    """Gains, friction, noise and what is left of each motor, and the centre of gravity by channel.

    Nothing for a calibration from circles alone. A number that the recordings leave open is None.
    """
    found = calibration.currents
    if found is None:
        return {}
    weight_n = platform_masses("drive-friction", calibration.layout.machine).platform_kg * GRAVITY_M_S2
    return {
        "motor_currents": {
            "weight_taken_as_known_n": weight_n,
            "motors": [_motor(calibration, found, motor) for motor in range(STRUTS)],
            "centre_of_gravity": _centre_of_gravity(calibration, found),
            "notes": list(found.notes),
        }
    }


def _fitted(calibration: Calibration, source: str) -> dict[str, tuple[float, float]]:
    """Values and standard deviations of a source's parameters."""
    sigma = np.sqrt(np.maximum(calibration.solution.variance, 0.0))
    numbers = zip(calibration.layout.names, calibration.x, sigma, strict=True)
    return {name: (float(value), float(u)) for (of, _, name), value, u in numbers if of == source}


def _number(value: float, uncertainty: float, unit: str) -> dict[str, Any]:
    return {"value": value, "uncertainty": uncertainty, "unit": unit}


def _motor(calibration: Calibration, found: MotorFindings, motor: int) -> dict[str, Any]:
    term = next(term for term in calibration.layout.terms if term.source.of_currents)
    numbers = _fitted(calibration, term.source.name)
    units = {p.name: p.unit for p in term.parameters}
    said: dict[str, Any] = {"motor": motor + 1}
    for kind in PER_MOTOR:
        name = of_motor(motor + 1, kind)
        said[kind] = None if name in found.held else _number(*numbers[name], units[name])
    gain, gain_u = numbers[of_motor(motor + 1, PER_MOTOR[0])]
    told = said[PER_MOTOR[0]] is not None and gain != 0.0
    force, force_u = (N_PER_KN / gain, N_PER_KN * gain_u / gain**2) if told else (0.0, 0.0)
    said["force_per_current"] = _number(force, force_u, "N/A") if told else None
    lead = calibration.layout.machine.screw_lead_mm
    turning = None if lead is None else lead / (2.0 * math.pi * MM_PER_M)
    known = told and turning is not None
    said["torque_per_current"] = _number(force * turning, force_u * turning, "Nm/A") if known and turning else None
    noise = found.noise[motor]
    said["residual_a"] = None if noise is None else found.residual_a[motor]
    said["noise_a"] = None if noise is None else found.fine_a[motor]
    said["noise_correlation_samples"] = None if noise is None else noise.correlation_samples
    said["samples"] = found.samples[motor]
    return said


def _centre_of_gravity(calibration: Calibration, found: MotorFindings) -> dict[str, Any]:
    """Each coordinate's shift by circles alone, by currents alone and by both."""
    together = _fitted(calibration, "cog-shift")
    said: dict[str, Any] = {}
    for name in next(iter(found.alone.values()), {}):
        alone = {channel: by_name[name] for channel, by_name in found.alone.items()}
        said[name] = {
            **{channel: None if number is None else _number(*number, "mm") for channel, number in alone.items()},
            "both": _number(*together[name], "mm"),
        }
    return said
