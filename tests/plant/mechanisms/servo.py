"""Drives that are late, or that stick for a moment when they turn round."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.signal import lfilter

from tests.plant.hexapod import strut_lengths
from tests.plant.mechanisms.base import Mechanism

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray
    from tests.plant.mechanisms.screw import Six
    from tests.plant.run import Motion

FINE_S = 0.0025


@dataclass(frozen=True)
class ServoLag(Mechanism):
    """Every position loop follows its command as a first-order filter with its own time constant [ms]."""

    name: ClassVar[str] = "servo-lag"

    time_constant_ms: Six = (2.0, 2.0, 3.0, 2.0, 2.0, 2.0)

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        del driven_mm
        if motion.slot is None:
            # Poses without a run have no path between them, and nothing moves at a standstill.
            return np.zeros_like(motion.commanded_mm)
        # A grid finer than the recording: between two samples the path is curved.
        times_s = np.arange(0.0, motion.slot.path.duration_s + FINE_S, FINE_S)
        asked_mm = strut_lengths(motion.machine, motion.slot.path.poses(times_s))
        at_s = motion.session_s - motion.slot.start_s
        late_mm = [
            np.interp(at_s, times_s, _filtered(asked_mm[:, strut], lag_ms / 1000.0) - asked_mm[:, strut])
            for strut, lag_ms in enumerate(self.time_constant_ms)
        ]
        return np.stack(late_mm, axis=1)


def _filtered(values: FloatArray, time_constant_s: float) -> FloatArray:
    """Exact first-order response `(m,)` to an input that runs straight between grid points, settled at its start."""
    if time_constant_s == 0.0:
        return values
    kept = np.exp(-FINE_S / time_constant_s)
    mean = (1.0 - kept) * time_constant_s / FINE_S
    moved = values - values[0]
    response = np.zeros_like(values)
    response[1:] = lfilter([1.0], [1.0, -kept], (1.0 - mean) * moved[1:] + (mean - kept) * moved[:-1])
    return response + values[0]


@dataclass(frozen=True)
class ReversalSpike(Mechanism):
    """At velocity reversal friction turns over at once and the position loop takes `decay_s` to make up for it."""

    name: ClassVar[str] = "reversal-spike"

    height_um: Six = (4.0, 4.0, 4.0, 4.0, 4.0, 4.0)
    decay_s: float = 0.2

    def driven_mm(self, motion: Motion, driven_mm: FloatArray) -> FloatArray:
        """The strut stays behind: too long after it stopped growing, too short after it stopped shrinking `(n, 6)`."""
        del driven_mm
        return np.stack([self._strut(motion, strut) for strut in range(6)], axis=1)

    def _strut(self, motion: Motion, strut: int) -> FloatArray:
        speed_mm_s = motion.strut_speed_mm_s[:, strut]
        times_s = motion.session_s
        moving = np.flatnonzero(np.abs(speed_mm_s) > 1e-6)
        turns = np.flatnonzero(np.diff(np.sign(speed_mm_s[moving])) != 0)
        spike_mm = np.zeros(len(times_s))
        for before, after in zip(moving[turns], moving[turns + 1], strict=True):
            at_s = times_s[after]
            if after == before + 1:
                share = speed_mm_s[before] / (speed_mm_s[before] - speed_mm_s[after])
                at_s = times_s[before] + share * (times_s[after] - times_s[before])
            height_mm = self.height_um[strut] / 1000.0 * np.sign(speed_mm_s[before])
            spike_mm[after:] += height_mm * np.exp(-(times_s[after:] - at_s) / self.decay_s)
        return spike_mm


@dataclass(frozen=True)
class TimeSkew(Mechanism):
    """The recorder's clock: a sample was really taken so much after the time written beside it [ms]."""

    name: ClassVar[str] = "time-skew"

    late_ms: float = 5.0

    def sampled_s(self, motion: Motion) -> FloatArray:
        del motion
        return np.array(self.late_ms / 1000.0)
