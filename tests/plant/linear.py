"""What small errors do to the readings of a session, to first order and without searching for poses.

The bar's sensitivity to the struts is the adjoint: with `n` the unit vector from the fixed to the moving ball solve
`Jᵀ g = [n, (R o) × n]`; then `dl/dL_i = g_i`, `dl/dQ_i = g_i u_i`, `dl/dP_i = -g_i Rᵀ u_i`, and a shift of the fixed
ball counts `-n`. So one look at what a mechanism does along the commanded path gives its signature.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tests.plant.hexapod import Platform, commanded_platform
from tests.plant.run import Motion
from tests.plant.simulate import built_machine

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from tests.plant.arrays import BoolArray, FloatArray
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.run import Scene, Slot

SAMPLES_PER_TURN = 240


@dataclass(frozen=True, eq=False)
class Course:
    """One run of the scene on a grid of times, with the sensitivities of its readings.

    `along` `(n, 3)` points from the fixed to the moving ball, `struts` `(n, 6)` is `dl/dL`.
    """

    motion: Motion
    kept: BoolArray
    nominal: Platform
    along: FloatArray
    struts: FloatArray

    @property
    def slot(self) -> Slot:
        return self.motion.of_run


class LinearSession:
    """All runs of a scene, ready to tell signatures: readings [mm] `(m,)` of the circles one after the other."""

    def __init__(self, scene: Scene, samples_per_turn: int = SAMPLES_PER_TURN) -> None:
        self.scene = scene
        self.courses = [_course(scene, slot, samples_per_turn) for slot in scene.slots]

    def signature(self, mechanisms: Sequence[Mechanism]) -> FloatArray:
        """Change of the readings `(m,)` by mechanisms, all together, with all that was random in them decided."""
        return self._joined(lambda course: _change_mm(course, mechanisms))

    def change(self, mechanism: Mechanism, carriers: Sequence[Mechanism] = ()) -> FloatArray:
        """What one more mechanism adds `(m,)` on a machine that has the carriers."""
        return self.signature([*carriers, mechanism]) - self.signature(carriers)

    @cached_property
    def kinematic(self) -> FloatArray:
        """`(m, 24)`: by six reference lengths and eighteen base joint coordinates."""
        return self._joined(lambda course: np.concatenate([course.struts, _base(course)], axis=1))

    @cached_property
    def platform_joints(self) -> FloatArray:
        """`(m, 18)`: by the platform joint coordinates."""
        return self._joined(lambda course: -(_base(course).reshape(-1, 6, 3) @ course.nominal.rotation).reshape(-1, 18))

    @cached_property
    def samples_per_s(self) -> FloatArray:
        """How many samples of the grid fall on a second `(m,)`."""
        return self._joined(lambda course: np.full(len(course.kept), 1.0 / np.diff(course.motion.session_s[:2])[0]))

    def shifts(self, of: Callable[[Slot], object]) -> FloatArray:
        """`(m, 3 k)`: shifts of the ball along X, Y, Z, shared by runs for which `of` says the same."""
        names = list(dict.fromkeys(of(course.slot) for course in self.courses))

        def columns(course: Course) -> FloatArray:
            block = np.zeros((len(course.along), len(names), 3))
            block[:, names.index(of(course.slot))] = -course.along
            return block.reshape(len(block), -1)

        return self._joined(columns)

    def lateness(self, mechanisms: Sequence[Mechanism]) -> FloatArray:
        """`(m, runs)`: readings [mm/s] by how late every run is believed to be, on a machine with these mechanisms."""

        def columns(course: Course) -> FloatArray:
            block = np.zeros((len(course.kept), len(self.courses)))
            block[:, self.courses.index(course)] = np.gradient(_change_mm(course, mechanisms), course.motion.session_s)
            return block

        return self._joined(columns)

    def by_strut(self, mechanism: Mechanism) -> FloatArray:
        """`(m, 6)`: a mechanism of struts and their joints, strut by strut."""
        return self._joined(lambda course: course.struts * _felt_mm(course, course.nominal, [mechanism]))

    def _joined(self, of: Callable[[Course], FloatArray]) -> FloatArray:
        return np.concatenate([of(course)[course.kept] for course in self.courses])


def _course(scene: Scene, slot: Slot, samples_per_turn: int) -> Course:
    turn_s = 2 * np.pi * slot.path.circle_radius_mm / slot.path.feed_mm_s
    time_s = np.arange(0.0, slot.path.duration_s, turn_s / samples_per_turn)
    motion = Motion(scene, slot.start_s + time_s, slot.path.poses(time_s), slot)
    nominal = commanded_platform(scene.machine, motion.commanded)
    along = nominal.position_mm - slot.path.centre_mm
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    pushed = np.concatenate([along, np.zeros_like(along)], axis=1)
    struts = np.linalg.solve(nominal.jacobian.transpose(0, 2, 1), pushed[:, :, None])[:, :, 0]
    return Course(motion, motion.in_circle, nominal, along, struts)


def _base(course: Course) -> FloatArray:
    return (course.struts[:, :, None] * course.nominal.direction).reshape(-1, 18)


def _strut_mm(course: Course, platform: Platform, mechanisms: Sequence[Mechanism]) -> FloatArray:
    """Strut lengths beyond the commanded ones `(n, 6)`."""
    motion = course.motion
    driven_mm = motion.commanded_mm
    grown_mm = np.zeros_like(driven_mm)
    for item in mechanisms:
        change_mm = item.driven_mm(motion, driven_mm)
        driven_mm = driven_mm if change_mm is None else driven_mm + change_mm
        growth_mm = item.lengthening_mm(motion, platform)
        grown_mm = grown_mm if growth_mm is None else grown_mm + growth_mm
    return driven_mm - motion.commanded_mm + grown_mm


def _felt_mm(course: Course, platform: Platform, mechanisms: Sequence[Mechanism]) -> FloatArray:
    """Strut lengths, and what comes to the same for the pose: joints moved along their struts `(n, 6)`."""
    nominal, believed = course.nominal, course.motion.machine
    base_mm = np.broadcast_to(platform.machine.base_joints_mm - believed.base_joints_mm, nominal.strut_mm.shape)
    joints_mm = np.broadcast_to(platform.machine.platform_joints_mm - believed.platform_joints_mm, base_mm.shape)
    for item in mechanisms:
        base_mm = _plus(base_mm, item.base_shift_mm(course.motion, platform))
        joints_mm = _plus(joints_mm, item.joint_shift_mm(course.motion, platform))
    moved_mm = base_mm - joints_mm @ nominal.rotation.transpose(0, 2, 1)
    return _strut_mm(course, platform, mechanisms) + np.einsum("nij,nij->ni", nominal.direction, moved_mm)


def _change_mm(course: Course, mechanisms: Sequence[Mechanism]) -> FloatArray:
    motion, nominal = course.motion, course.nominal
    actual = built_machine(motion.machine, mechanisms)
    # Geometry stays nominal, weights are the actual ones: their loads decide about tensions.
    platform = Platform(
        nominal.position_mm,
        nominal.rotation,
        motion.machine.base_joints_mm[None],
        motion.machine.platform_joints_mm[None],
        actual,
    )
    platform.extra_loads = [lambda loaded, item=item: item.load(motion, loaded) for item in mechanisms]  # type: ignore[misc]
    ball_mm = np.zeros_like(nominal.position_mm)
    tool_mm = np.zeros_like(ball_mm)
    for item in mechanisms:
        ball_mm = _plus(ball_mm, item.fixed_ball_mm(motion, platform))
        tool_mm = _plus(tool_mm, item.tool_ball_mm(motion, platform))
    in_machine_mm = (nominal.rotation @ tool_mm[:, :, None])[:, :, 0] - ball_mm
    change_mm = np.einsum("ni,ni->n", course.struts, _felt_mm(course, platform, mechanisms)) + np.einsum(
        "ni,ni->n", course.along, in_machine_mm
    )
    for item in mechanisms:
        change_mm = _plus(change_mm, item.reading_mm(motion, platform, course.slot.path.path.radius_mm + change_mm))
    late_s = np.zeros(len(change_mm))
    for item in mechanisms:
        late_s = _plus(late_s, item.sampled_s(motion))
    return change_mm + late_s * np.gradient(change_mm, motion.session_s) if late_s.any() else change_mm


def _plus(total: FloatArray, change: FloatArray | None) -> FloatArray:
    return total if change is None else total + change
