"""One run of a session, as mechanisms get to see it, and the session around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tests.plant.hexapod import strut_lengths

if TYPE_CHECKING:
    from tests.plant.arrays import BoolArray, FloatArray
    from tests.plant.drive_path import RunPath
    from tests.plant.machine import Machine
    from tests.plant.plan import Direction, Plan, Test


@dataclass(frozen=True)
class Slot:
    """A run in the order of the session: what is measured, on which mounting, and when it begins [s]."""

    test: Test
    direction: Direction
    repeat: int
    mounting: int
    start_s: float
    path: RunPath

    @property
    def end_s(self) -> float:
        return self.start_s + self.path.duration_s

    @property
    def stem(self) -> str:
        return f"{self.test.name}-{self.direction}-{self.repeat}"


@dataclass(frozen=True)
class Scene:
    """Everything that is fixed before a session begins: nominal machine, plan and the runs in order."""

    machine: Machine
    plan: Plan
    slots: tuple[Slot, ...]
    ambient_temp_c: float = 20.0

    @property
    def end_s(self) -> float:
        return max((slot.end_s for slot in self.slots), default=0.0)


@dataclass(frozen=True)
class Motion:
    """A commanded motion in time order: n samples at session times [s] with commanded poses `(n, 6)` [mm, deg].

    `slot` is None for poses that belong to no run, for which nothing is known about balls and bar.
    """

    scene: Scene
    session_s: FloatArray
    commanded: FloatArray
    slot: Slot | None = None

    @property
    def machine(self) -> Machine:
        return self.scene.machine

    @cached_property
    def commanded_mm(self) -> FloatArray:
        """Strut lengths `(n, 6)` to which the controller drives."""
        return strut_lengths(self.machine, self.commanded) - self.machine.reference_length_error_mm

    @property
    def of_run(self) -> Slot:
        if self.slot is None:
            raise ValueError("these poses belong to no run: no ball, no bar")
        return self.slot

    @cached_property
    def angle_deg(self) -> FloatArray:
        """Commanded angle `(n,)` of the bar."""
        slot = self.of_run
        return slot.path.angle_deg(self.session_s - slot.start_s)

    @cached_property
    def in_circle(self) -> BoolArray:
        """Where `(n,)` the 360 degrees of data are."""
        slot = self.of_run
        return slot.path.in_circle(self.session_s - slot.start_s)

    @cached_property
    def strut_speed_mm_s(self) -> FloatArray:
        """Commanded strut speeds `(n, 6)`."""
        if len(self.session_s) == 1:
            return np.zeros((1, 6))
        return np.gradient(self.commanded_mm, self.session_s, axis=0)
