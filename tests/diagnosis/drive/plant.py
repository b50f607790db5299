"""A drive under a controller, integrated in time: shares no code with the program that identifies it.

Mass on a screw, driven by a force that a sampled PD controller with feed-forward gives; the encoder that closes the
loop is quantised. Friction with stiction after Karnopp: below a small speed it holds the mass as long as it can.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

RATE_HZ = 1000
SUBSTEPS = 10
STICKS_M_S = 2e-5


@dataclass(frozen=True)
class Truth:
    """What the drive is; forces in N, speeds in m/s, positions in m, time in s.

    `load` is a force that the drive must add, of time, position, speed; `sliding` a friction in the direction of travel,
    of the same and of the travel since the last reversal.
    """

    mass_kg: float = 80.0
    viscous: float = 200.0
    coulomb: float = 0.0
    coulomb_asymmetry: float = 0.0
    viscous_asymmetry: float = 0.0
    load: Callable[[float, float, float], float] = field(default=lambda *_: 0.0)
    sliding: Callable[[float, float, float, float], float] = field(default=lambda *_: 0.0)


def to_and_fro(speeds=(0.04, 0.08, 0.12), stroke=0.2, acceleration=1.5, seconds=24.0):
    """Set position over time [m]: strokes to and fro with trapezoidal speed, another speed each stroke."""
    dt = 1.0 / RATE_HZ
    x, sign, out, k = 0.0, 1.0, [], 0
    while len(out) * dt < seconds:
        v = speeds[k % len(speeds)]
        ramp = max(int(v / acceleration / dt), 1)
        cruise = max(round((stroke - v * ramp * dt) / (v * dt)), 1)
        profile = np.concatenate([np.linspace(0, v, ramp, endpoint=False), np.full(cruise, v), np.linspace(v, 0, ramp)])
        steps = sign * profile * dt
        out.extend(x + np.cumsum(steps))
        x = out[-1]
        sign, k = -sign, k + 1
    return np.array(out[: int(seconds / dt)])


def at_constant_speed(speed=0.02, seconds=10.0, wobble=0.0):
    """Set position of a drive that was at its speed before the recording began; the speed may vary slowly."""
    t = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    return speed * t + wobble * speed * (1 - np.cos(2 * np.pi * 0.2 * t)) / (2 * np.pi * 0.2)


def record(truth, command, seed=1, *, force_noise=0.5, position_noise=2e-8, resolution=1e-7, early_samples=0.0):
    """Return t_s, position_mm, force_n of a drive that follows a command, shape (n,) each.

    The recorded force is the mean over the sampling step about its stamp, later by `early_samples` of them.
    """
    rng = np.random.default_rng(seed)
    dt, h = 1.0 / RATE_HZ, 1.0 / RATE_HZ / SUBSTEPS
    speed = np.gradient(command, dt)
    accel = np.gradient(speed, dt)
    x, v = float(command[0]), float(speed[0])
    turned_at, way = -1e9 if v > 0 else 1e9, math.copysign(1.0, v) if v else 1.0
    last, estimate = x, v
    applied, measured = np.empty(len(command)), np.empty(len(command))
    for k in range(len(command)):
        t = k * dt
        seen = round((x + rng.normal(0.0, position_noise)) / resolution) * resolution
        measured[k] = seen
        estimate += 0.3 * ((seen - last) / dt - estimate)
        last = seen
        force = 95.0 * accel[k] + 250.0 * speed[k] + 4e5 * (command[k] - seen) + 6e3 * (speed[k] - estimate)
        force = max(-400.0, min(400.0, force))
        applied[k] = force
        for _ in range(SUBSTEPS):
            direction = math.copysign(1.0, v) if v else way
            if direction != way and abs(v) > STICKS_M_S:
                way, turned_at = direction, x
            free = force - truth.load(t, x, v)
            dry = truth.coulomb + direction * truth.coulomb_asymmetry
            dry += truth.sliding(t, x, v, abs(x - turned_at))
            if abs(v) < STICKS_M_S and abs(free) <= dry:
                v = 0.0
                continue
            if abs(v) < STICKS_M_S:
                direction = math.copysign(1.0, free)
            # Trapezoidal rule: explicit steps would act like a mass that is smaller by h c / 2.
            wet = 0.5 * h * (truth.viscous + direction * truth.viscous_asymmetry) / truth.mass_kg
            new = (v * (1.0 - wet) + h * (free - direction * dry) / truth.mass_kg) / (1.0 + wet)
            # Friction stops the mass, it does not turn it round.
            new = 0.0 if v * new < 0.0 and abs(free) <= dry else new
            x += 0.5 * h * (v + new)
            v = new
    before = np.concatenate([applied[:1], applied[:-1]])
    mean = (0.5 + early_samples) * applied + (0.5 - early_samples) * before
    t = np.arange(len(command)) * dt
    return t, 1e3 * measured, mean + rng.normal(0.0, force_noise, len(command))
