"""Friction in the base joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.play import PlayState, leaning, resistance
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.statics import stretch_mm, strut_tensions, transverse_load
from dbbstation.sources.contract import (
    SMOOTH_MM,
    Effect,
    Motion,
    Need,
    Owner,
    SourceWithHistory,
    Texts,
    of_each_strut,
)
from dbbstation.sources.laws.weights import for_such_struts, strut_compliance

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Hexapod, Machine
    from dbbstation.machine.kinematics import Struts
    from dbbstation.sources.contract import Parameter

LEVER_MM = 1000.0
"""Lever arm that converts the parameter to a moment: 1 N at 1000 mm is 1 N m."""

WIND_UP_RAD = 1e-4
"""Angle over which a joint's friction reverses, for preloaded rolling bearings: a tenth of a millimetre at the
platform, about two degrees of a circle of 150 mm."""

OTHERS = 3.0
"""Factor by which this angle may differ for joints of another make and preload. For joints of the tests' virtual
machine that wind up over 40, 160 and 600 µrad, at most 16, 16 and 18 % of the effect on [CAL Table II] remain; 16, 16
and 22 % with a factor of 1.5, 16, 16 and 16 % with 6."""


class JointFriction(SourceWithHistory):
    """Friction in a base joint makes its strut pull on the platform, which stretches all six struts.

    A universal joint has the axes e1, fixed in the base, level, and perpendicular to the strut at mid-travel, and e2,
    perpendicular to e1 and strut. The moment about an axis is M z, with z from -1 (growing angle) to +1 over a small
    wind-up (stop operator). By virtual work f = M (z_1 dq_1/dp + z_2 dq_2/dp) for platform joint p and angles q.
    Tensions follow from J^T T = [sum f, sum (R P) x f]. Circles show only friction times the machine file's compliance.

    Platform joints rotate by nearly equal angles, so the result includes their friction.
    """

    name = "joint-friction"
    belongs_to = Owner.MACHINE
    detail_mm = SMOOTH_MM
    needs = frozenset({Need.POSE, Need.PATH})
    varies_with = "joint-angle-speed-sign"
    form_uncertainty = 0.3  # friction of joints differs with load and angle
    texts = Texts(
        what="The joints at the base turn heavily. Friction drags at the platform against its movement, and the struts "
        "stretch under that.",
        shows="Small steps of some tenths of a µm where a strut's joint reverses its swing, which is where the strut "
        "lies farthest to one side, not where it is longest or shortest. Clockwise and counter-clockwise runs differ.",
        confirm="Prop the platform up, take one strut off it, and measure with a spring balance at the strut's end what "
        "it takes to swing it in either direction.",
        cure="Lubricate the joints, or lower the preload of their bearings.",
        equation="J^T T = [sum f, sum (R P) x f], f = M (z_1 dq_1/dp + z_2 dq_2/dp), z nearly minus the sign of dq/dt; "
        "actual minus driven length = c(L) T; one axis of each joint is taken to be level and square to its strut",
        origin="Coulomb's friction about both axes of a universal joint, virtual work, and the equilibrium of the "
        "platform as in [GRAV eq 1, 6, 7]",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        meaning = f"force that swings strut {{}}, 1 m from its base joint; {for_such_struts(machine)}"
        return of_each_strut("strut_{}_n", "N", 10.0, meaning, positive=True)

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> PlayState:  # noqa: ARG002
        self.require(motion)
        return leaning(joint_angles(motion.struts(machine), outer_axes(machine.hexapod)).angle_rad)

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: PlayState) -> tuple[Effect, PlayState]:
        struts = motion.struts(machine)
        drag, behind = friction_drag(struts, outer_axes(machine.hexapod), state)
        tension = strut_tensions(struts, transverse_load(struts, values[:, None] * drag))
        return Effect(strut_mm=stretch_mm(struts, strut_compliance(machine), tension)), behind

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return effects of the outer axis alone, of each axis varying with inclination, and of other wind-up angles.

        Bearings differ, and their load changes with inclination. Wind-up shows only at small swings.
        """
        struts, axes = motion.struts(machine), outer_axes(machine.hexapod)
        joints = joint_angles(struts, axes)
        acting = resistance(joints.angle_rad, WIND_UP_RAD)[0]
        outer, inner = drags(joints, acting)
        leans = np.sin(joints.angle_rad[:, STRUTS:, None]) ** 2
        parts = [
            self.form_uncertainty * np.where(np.arange(STRUTS)[:, None] == joint, drag, 0.0)
            for joint in np.flatnonzero(values)
            for drag in (outer, outer * leans, inner * leans)
        ]
        for angle in (OTHERS * WIND_UP_RAD, WIND_UP_RAD / OTHERS):
            other = resistance(joints.angle_rad, angle)[0] - acting
            outer, inner = drags(joints, other)
            parts.append(outer + inner)
        return Effect(strut_mm=_stretched(machine, struts, (values[:, None] * part for part in parts)))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        self.require(motion)
        struts = motion.struts(machine)
        drag, _ = friction_drag(struts, outer_axes(machine.hexapod))
        alone = (np.where(np.arange(STRUTS)[:, None] == i, drag, 0.0) for i in range(STRUTS))
        return Effect(strut_mm=_stretched(machine, struts, alone))


def _stretched(machine: Machine, struts: Struts, drags: Iterable[Floats]) -> Floats:
    """Return the stretch of the struts under each drag, shape (n, 6, p) [mm]."""
    tensions = (strut_tensions(struts, transverse_load(struts, drag)) for drag in drags)
    return np.stack([stretch_mm(struts, strut_compliance(machine), tension) for tension in tensions], axis=-1)


def outer_axes(hexapod: Hexapod) -> Floats:
    """Return the base-fixed axes of base joints, unit vectors, machine frame, shape (6, 3)."""
    across = hexapod.platform_joints_mm[:, :2] - hexapod.base_joints_mm[:, :2]
    across[np.linalg.norm(across, axis=1) == 0.0] = [0.0, 1.0]  # a vertical strut may have any level axis
    axes = np.column_stack([-across[:, 1], across[:, 0], np.zeros(STRUTS)])
    unit: Floats = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return unit


@dataclass(frozen=True, eq=False)
class JointAngles:
    """Angles of base joints, and their derivatives by the platform joints' places.

    Attributes:
        angle_rad: outer axes of six joints, then inner ones, shape (n, 12).
        by_first: outer angle by platform joint, shape (n, 6, 3) [rad/mm].
    """

    angle_rad: Floats
    by_first: Floats
    by_second: Floats


def joint_angles(struts: Struts, axes: Floats) -> JointAngles:
    """Return the joints' angles along a path."""
    unit = struts.unit
    aside = np.einsum("nij,ij->ni", unit, axes)  # sine of the second angle
    round_axis = np.cross(axes, unit)
    # The strut's component perpendicular to e1 rotates about e1 by q1, counted from vertically down: no strut points
    # up.
    level = np.cross(axes, np.array([0.0, 0.0, -1.0]))
    first = np.arctan2(np.einsum("nij,ij->ni", unit, level), -unit[:, :, 2])
    part = 1.0 - aside**2  # square of this component
    length = struts.length_mm[:, :, None]
    return JointAngles(
        np.hstack([first, np.arcsin(aside)]),
        round_axis / (length * part[:, :, None]),
        (axes - aside[:, :, None] * unit) / (length * np.sqrt(part)[:, :, None]),
    )


def friction_drag(struts: Struts, axes: Floats, state: PlayState | None = None) -> tuple[Floats, PlayState]:
    """Return forces on platform joints for 1 N m of friction about each base axis, (n, 6, 3) [N].

    Returns:
        The forces, and the state after the last row.
    """
    joints = joint_angles(struts, axes)
    acting, behind = resistance(joints.angle_rad, WIND_UP_RAD, state)
    outer, inner = drags(joints, acting)
    return outer + inner, behind


def drags(joints: JointAngles, acting: Floats) -> tuple[Floats, Floats]:
    """Return forces on platform joints for given shares of 1 N m, (n, 6, 3) [N]."""
    return (
        LEVER_MM * acting[:, :STRUTS, None] * joints.by_first,
        LEVER_MM * acting[:, STRUTS:, None] * joints.by_second,
    )
