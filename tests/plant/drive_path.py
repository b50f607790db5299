"""The commanded motion of one run, in time.

Dwell outside the circle, radial feed-in along the bar, dwell, overshoot arc, 360 degrees of data, overshoot arc, dwell,
feed-out, dwell. Every move ramps its speed up and down linearly, as controls with exact stop do: a move of length s at
feed v takes s/v plus one ramp time.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tests.plant.arrays import BoolArray, FloatArray
    from tests.plant.plan import Direction, Path, Plan, Test


@dataclass(frozen=True)
class Timing:
    """What the control adds to the programmed path [s]."""

    outer_dwell_s: float = 1.0
    corner_dwell_s: float = 0.3
    ramp_s: float = 0.03


@dataclass(frozen=True)
class Leg:
    """A part of the path: nothing but time, or a move by `length_mm`."""

    start_s: float
    end_s: float
    length_mm: float = 0.0


class RunPath:
    """Commanded pose of a run as a function of time."""

    def __init__(self, plan: Plan, test: Test, direction: Direction, timing: Timing) -> None:
        self.path: Path = plan.path_of(test)
        self.test = test
        self.direction = direction
        self.centre_mm = plan.in_machine_mm(np.array(plan.ball(test.ball).centre_mm))
        self._elevation_rad = np.radians(test.elevation_deg)
        self.circle_radius_mm = self.path.radius_mm * float(np.cos(self._elevation_rad))
        self._swept_deg = 360.0 + 2.0 * self.path.overshoot_deg
        self._legs = self._timetable(timing)
        self._ramp_s = timing.ramp_s
        self.duration_s = self._legs[-1].end_s

    @property
    def feed_mm_s(self) -> float:
        return self.path.feed_mm_min / 60.0

    @property
    def arc_s(self) -> tuple[float, float]:
        return self._legs[3].start_s, self._legs[3].end_s

    def _timetable(self, timing: Timing) -> list[Leg]:
        arc_mm = self.circle_radius_mm * float(np.radians(self._swept_deg))
        feed_in_mm = self.path.feed_in_mm
        lengths_mm = [0.0, feed_in_mm, 0.0, arc_mm, 0.0, feed_in_mm, 0.0]
        dwells_s = [
            timing.outer_dwell_s,
            0.0,
            timing.corner_dwell_s,
            0.0,
            timing.corner_dwell_s,
            0.0,
            timing.outer_dwell_s,
        ]
        durations_s = [
            length_mm / self.feed_mm_s + timing.ramp_s if length_mm > 0 else dwell_s
            for length_mm, dwell_s in zip(lengths_mm, dwells_s, strict=True)
        ]
        times_s = np.concatenate([[0.0], np.cumsum(durations_s)])
        return [
            Leg(float(start_s), float(end_s), length_mm)
            for (start_s, end_s), length_mm in zip(pairwise(times_s), lengths_mm, strict=True)
        ]

    def _travelled_mm(self, leg: Leg, time_s: FloatArray) -> FloatArray:
        """Way `(n,)` covered on a leg: the integral of a trapezoid of speed."""
        since_s = np.clip(time_s - leg.start_s, 0.0, leg.end_s - leg.start_s)
        if leg.length_mm == 0.0 or self._ramp_s == 0.0:
            return np.minimum(since_s * self.feed_mm_s, leg.length_mm)
        left_s = leg.end_s - leg.start_s - since_s

        def lost_mm(to_the_end_s: FloatArray) -> FloatArray:
            return 0.5 * np.maximum(self._ramp_s - to_the_end_s, 0.0) ** 2 / self._ramp_s * self.feed_mm_s

        half_ramp_mm = 0.5 * self._ramp_s * self.feed_mm_s
        return since_s * self.feed_mm_s - half_ramp_mm + lost_mm(since_s) - lost_mm(left_s)

    def angle_deg(self, time_s: FloatArray) -> FloatArray:
        """Commanded angle `(n,)` in the machine's XY plane, not wrapped; falls with time for `cw`."""
        arc_mm = self._travelled_mm(self._legs[3], time_s)
        phi_deg = np.degrees(arc_mm / self.circle_radius_mm) - self.path.overshoot_deg
        return self.path.start_deg + (phi_deg if self.direction == "ccw" else -phi_deg)

    def in_circle(self, time_s: FloatArray) -> BoolArray:
        """Where `(n,)` the 360 degrees of data are."""
        phi_deg = np.abs(self.angle_deg(time_s) - self.path.start_deg)
        moving = (time_s >= self.arc_s[0]) & (time_s <= self.arc_s[1])
        forward = (self.angle_deg(time_s) - self.path.start_deg) * (1 if self.direction == "ccw" else -1) >= 0
        return moving & forward & (phi_deg < 360.0)

    def bar_direction(self, angle_deg: FloatArray) -> FloatArray:
        """Commanded unit vectors `(n, 3)` from the fixed ball to the moving ball."""
        angle_rad = np.radians(angle_deg)
        ce, se = np.cos(self._elevation_rad), np.sin(self._elevation_rad)
        return np.stack([ce * np.cos(angle_rad), ce * np.sin(angle_rad), np.full_like(angle_rad, se)], axis=1)

    def poses(self, time_s: FloatArray) -> FloatArray:
        """Commanded poses `(n, 6)` [mm, deg] at times `(n,)` since the first dwell began."""
        moved_in_mm = self._travelled_mm(self._legs[1], time_s) - self._travelled_mm(self._legs[5], time_s)
        reach_mm = self.path.radius_mm + self.path.feed_in_mm - moved_in_mm
        position_mm = self.centre_mm + reach_mm[:, None] * self.bar_direction(self.angle_deg(time_s))
        tilt_deg = np.broadcast_to([self.test.a_deg, self.test.b_deg, 0.0], position_mm.shape)
        return np.concatenate([position_mm, tilt_deg], axis=1)
