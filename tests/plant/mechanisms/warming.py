"""How a part of the machine warms over a session: bodies heated one through the other.

Each stage follows the one before it, `τ dT/dt = T_before - T`. The first one follows the heat that the drives give off,
scaled so that full heat for ever means `rise_k`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.run import Motion, Scene

GRID_S = 1.0


@dataclass(frozen=True)
class Warming:
    """A warm-up: final rise [K], time constants [s] of one or two stages, and the heat between runs.

    `idle_share` is the heat while no run is on, relative to a run; with 1 the machine warms as a step response.
    `head_start_s` is how long it had been warming when the first run began, `start_k` what was left of an earlier warmth
    then or, with a head start, at the start of that. No heat comes during `off_s`, from and to in session time: a break
    with the drives switched off, or a machine that only cools.
    """

    rise_k: float
    time_constant_s: float
    second_time_constant_s: float | None = None
    idle_share: float = 1.0
    head_start_s: float = 0.0
    start_k: float = 0.0
    off_s: tuple[tuple[float, float], ...] = ()

    def excess_k(self, motion: Motion) -> FloatArray:
        """Temperature `(n,)` above the cold machine [K] at the instants of a motion."""
        times_s, excess_k = self.history(motion.scene, float(motion.session_s.max()))
        return np.interp(motion.session_s, times_s, excess_k)

    def history(self, scene: Scene, until_s: float) -> tuple[FloatArray, FloatArray]:
        times_s = np.arange(-self.head_start_s, max(until_s, scene.end_s) + 2 * GRID_S, GRID_S)
        # What heats during the second that ends at a grid point is known at its middle.
        heat = np.full(len(times_s), self.idle_share)
        middles_s = times_s - GRID_S / 2
        for slot in scene.slots:
            heat[(middles_s >= slot.start_s) & (middles_s < slot.end_s)] = 1.0
        for from_s, to_s in self.off_s:
            heat[(middles_s >= from_s) & (middles_s < to_s)] = 0.0
        excess_k = self.rise_k * _followed_steps(heat, self.time_constant_s)
        if self.second_time_constant_s is not None:
            excess_k = _followed_ramps(excess_k, self.second_time_constant_s)
        slowest_s = max(self.time_constant_s, self.second_time_constant_s or 0.0)
        return times_s, excess_k + self.start_k * np.exp(-(times_s - times_s[0]) / slowest_s)


@dataclass(frozen=True)
class Shop(Warming):
    """A part that follows the air of the shop: it swings with a period, and a door that opened lets it fall.

    `rise_k` is the swing's amplitude, `time_constant_s` that of the fall.
    """

    period_s: float = 5400.0
    door_s: float = 2500.0
    door_k: float = -1.5

    def history(self, scene: Scene, until_s: float) -> tuple[FloatArray, FloatArray]:
        times_s = np.arange(-self.head_start_s, max(until_s, scene.end_s) + 2 * GRID_S, GRID_S)
        swing = self.rise_k * np.sin(2.0 * np.pi * times_s / self.period_s)
        since_s = np.maximum(times_s - self.door_s, 0.0)
        return times_s, self.start_k + swing + self.door_k * -np.expm1(-since_s / self.time_constant_s)


@dataclass(frozen=True)
class SeveralBodies(Warming):
    """A part heated through several bodies at once, each `(share, factor)`: of the rise, and of the time constants.

    Few bodies far apart make a warm-up with a fast and a slow part, many close together a stretched one.
    """

    bodies: tuple[tuple[float, float], ...] = ((1.0, 1.0),)

    def history(self, scene: Scene, until_s: float) -> tuple[FloatArray, FloatArray]:
        law = {key.name: getattr(self, key.name) for key in fields(Warming)}
        total_k: FloatArray | float = 0.0
        for share, factor in self.bodies:
            second_s = self.second_time_constant_s
            law["time_constant_s"] = factor * self.time_constant_s
            law["second_time_constant_s"] = None if second_s is None else factor * second_s
            times_s, excess_k = Warming(**law).history(scene, until_s)
            total_k = total_k + share * excess_k
        return times_s, np.asarray(total_k)


def stretched(spread: float) -> tuple[tuple[float, float], ...]:
    """Five bodies whose time constants scatter log-normally, with `spread` as standard deviation of the logarithm."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    shares = weights / weights.sum()
    return tuple((float(share), float(np.exp(spread * node))) for share, node in zip(shares, nodes, strict=True))


def _followed_steps(values: FloatArray, time_constant_s: float) -> FloatArray:
    """Exact first-order response `(m,)` to an input `(m,)` constant within each second, from rest."""
    kept = np.exp(-GRID_S / time_constant_s)
    response = np.zeros_like(values)
    response[1:] = lfilter([1.0 - kept], [1.0, -kept], values[1:])
    return response


def _followed_ramps(values: FloatArray, time_constant_s: float) -> FloatArray:
    """Exact first-order response `(m,)` to an input `(m,)` that runs straight from second to second, from rest."""
    kept = np.exp(-GRID_S / time_constant_s)
    # For a ramp the response lags by τ: weights of the new and the old value of the input.
    mean = (1.0 - kept) * time_constant_s / GRID_S
    response = np.zeros_like(values)
    response[1:] = lfilter([1.0], [1.0, -kept], (1.0 - mean) * values[1:] + (mean - kept) * values[:-1])
    return response
