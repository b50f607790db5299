"""A machine with serial axes X and Y and the faults that its ball-bar circles are read for, by its axes' positions in time.

Nothing here is linear in the faults or knows their shapes on a circle: each axis goes where its own fault takes it, and the bar
is as long as that makes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tests.plant.arrays import FloatArray


@dataclass(frozen=True)
class Axis:
    """Faults of one axis.

    `late_ms` behind its command; `scale_um_m` too far; play of `plus_um` and `minus_um` where it turns round at its positive and
    negative end; at both it sticks for `spike_deg` of the circle and then stands `spike_um` outside; an error of `cyclic_um` comes
    back every `period_mm`.
    """

    late_ms: float = 0.0
    scale_um_m: float = 0.0
    plus_um: float = 0.0
    minus_um: float = 0.0
    spike_plus_um: float = 0.0
    spike_minus_um: float = 0.0
    cyclic_um: float = 0.0
    period_mm: float = 10.0
    phase_rad: float = 0.0


@dataclass(frozen=True)
class SerialMachine:
    """Two axes that include 90 degrees and `square_um_m` more."""

    x: Axis = Axis()
    y: Axis = Axis()
    square_um_m: float = 0.0
    spike_deg: float = 3.0

    def length_mm(
        self,
        theta_deg: FloatArray,
        radius_mm: float,
        feed_mm_min: float,
        sense: int,
        ball_mm: tuple[float, float] = (0.0, 0.0),
    ) -> FloatArray:
        """Distance of the tool from a ball near the centre `(n,)` at commanded angles, `sense` +1 counter-clockwise."""
        theta = np.radians(theta_deg)
        speed_rad_s = feed_mm_min / 60.0 / radius_mm
        x, y = (
            self._goes(axis, theta, radius_mm, sense, speed_rad_s, quarter)
            for axis, quarter in ((self.x, 0.0), (self.y, np.pi / 2))
        )
        tilt = 1e-6 * self.square_um_m
        return np.hypot(x - y * np.sin(tilt) - ball_mm[0], y * np.cos(tilt) - ball_mm[1])

    def _goes(
        self, axis: Axis, theta: FloatArray, radius_mm: float, sense: int, speed_rad_s: float, quarter: float
    ) -> FloatArray:
        along = theta - quarter
        commanded = radius_mm * np.cos(along - sense * speed_rad_s * 1e-3 * axis.late_ms)
        forward = -sense * np.sin(along) > 0.0
        place = np.cos(along)
        play_um = 0.5 * (1.0 + place) * axis.plus_um + 0.5 * (1.0 - place) * axis.minus_um
        error_um = np.where(forward, -0.5, 0.5) * play_um
        error_um = error_um + axis.cyclic_um * np.sin(2.0 * np.pi * commanded / axis.period_mm + axis.phase_rad)
        length = np.radians(self.spike_deg)
        for end, height_um, outwards in ((0.0, axis.spike_plus_um, 1.0), (np.pi, axis.spike_minus_um, -1.0)):
            behind = np.mod(sense * (along - end), 2.0 * np.pi)
            # A radial height h at an end is one of the axis of h / cos there.
            shape = np.where(behind < length, np.sin(np.pi * np.minimum(behind / length, 1.0)), 0.0)
            error_um = error_um + outwards * height_um * shape / np.maximum(np.abs(place), 0.5)
        return commanded * (1.0 + 1e-6 * axis.scale_um_m) + 1e-3 * error_um
