"""What a hexapod is: its joints, its travel, its screws and masses."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.rotation import Rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray

STRUTS = 6

GREATEST_FEED_MM_MIN = 100_000.0
"""Feed that a machine is taken to reach where its file says nothing: 100 m/min, the rapid of the fastest parallel machine
tools. It keeps senseless numbers out of programs; what the machine really reaches belongs into its file [mm/min]."""

GREATEST_TURN_DEG_MIN = 36_000.0
"""The same for moves that only turn: a hundred turns per minute [deg/min]."""

ACCELERATION_MM_S2 = 1000.0
"""Acceleration of the tool tip that a control is taken to plan with where the machine file says nothing: 1 m/s², a tenth of
gravity, at the lower end of machine tools. Pieces that keep their feed with it keep it with more [mm/s²]."""


@dataclass(frozen=True, eq=False)
class Hexapod:
    """Joints of a Stewart platform [CAL Fig 1], either as designed or as a particular machine has them.

    Attributes:
        base_joints_mm: Q, machine frame, shape (6, 3), or (n, 6, 3) where they move from sample to sample [mm].
        platform_joints_mm: P, platform frame with its origin at the tool tip, shape (6, 3) or (n, 6, 3) [mm].
        rotation: convention of the tilt angles.
    """

    base_joints_mm: NDArray[np.float64]
    platform_joints_mm: NDArray[np.float64]
    rotation: Rotation = Rotation.XYZ

    def moved(self, base_mm: NDArray[np.float64], platform_mm: NDArray[np.float64]) -> Hexapod:
        """Return the same hexapod with joints shifted by these amounts, shapes (6, 3) or (n, 6, 3) [mm]."""
        return replace(
            self,
            base_joints_mm=self.base_joints_mm + base_mm,
            platform_joints_mm=self.platform_joints_mm + platform_mm,
        )


@dataclass(frozen=True)
class Travel:
    """Limits of the machine, each a pair (least, greatest)."""

    xy_radius_mm: float
    x_mm: tuple[float, float]
    y_mm: tuple[float, float]
    z_mm: tuple[float, float]
    a_deg: tuple[float, float]
    b_deg: tuple[float, float]
    c_deg: tuple[float, float]
    strut_mm: tuple[float, float]


@dataclass(frozen=True)
class Masses:
    """What gravity acts on; a part that is not known is None.

    Attributes:
        centre_of_gravity_above_tip_mm: on the platform's axis, from the tool tip [mm].
    """

    platform_kg: float
    centre_of_gravity_above_tip_mm: float


@dataclass(frozen=True)
class Compliance:
    """How much a strut stretches under an axial force, by design [GRAV eq 7].

    Attributes:
        at_1000mm_mm_per_n: elongation per force of a strut of 1000 mm between its joints [mm/N].
        growing_share: part of that which grows with the strut's length, as a rod does; the rest (screw, nut,
            bearings, joints) is the same at every length [1].
    """

    at_1000mm_mm_per_n: float
    growing_share: float = 0.9


@dataclass(frozen=True)
class StrutMasses:
    """What each of the six struts weighs, on a line through its two joints [GRAV Fig 2].

    Attributes:
        strut_kg: what lies evenly between base joint and platform joint, whatever the length [kg].
        motor_kg: what sits behind the base joint, turning with the strut [kg].
        motor_length_mm: of that part; its centre is half of it behind the joint [mm].
        screw_kg: screw that ends at the platform joint and slides through the base joint [kg].
        screw_length_mm: of that screw; its rear end sticks out behind the joint [mm].
    """

    strut_kg: float
    motor_kg: float
    motor_length_mm: float
    screw_kg: float = 0.0
    screw_length_mm: float = 0.0


@dataclass(frozen=True, eq=False)
class JointAxes:
    """Directions of the axes of universal joints that are fixed in base and platform, of any length.

    A universal joint turns about two axes: the first is fixed in base or platform, the second in the strut, across it.

    Attributes:
        base: machine frame, shape (6, 3) [1].
        platform: platform frame, shape (6, 3) [1].
    """

    base: NDArray[np.float64]
    platform: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Machine:
    """The nominal machine: what its controller believes.

    Attributes:
        reference_length_error_mm: already corrected by the controller, which drives strut i to F_i(T) minus this, shape (6,)
            [mm].
        screw_lead_mm: travel of a strut per turn of its screw [mm]; None where not known.
        masses: what gravity acts on; None where not known.
        joint_tolerance_mm: standard deviation of a base-joint coordinate after assembly [mm]; None where not known.
        compliance: of the struts as designed; None where not known.
        strut_masses: of the struts as designed; None where not known.
        joint_axes: of universal joints; None where not known, or where the joints are balls.
        greatest_feed_mm_min: of the tool tip [mm/min]; None where not known.
        greatest_turn_deg_min: of the tilt angles where the tool tip stands still [deg/min]; None where not known.
        acceleration_mm_s2: of the tool tip, that the control plans with [mm/s²]; None where not known.
    """

    name: str
    hexapod: Hexapod
    travel: Travel
    reference_length_error_mm: NDArray[np.float64] = field(default_factory=lambda: np.zeros(STRUTS))
    screw_lead_mm: float | None = None
    masses: Masses | None = None
    joint_tolerance_mm: float | None = None
    compliance: Compliance | None = None
    strut_masses: StrutMasses | None = None
    joint_axes: JointAxes | None = None
    greatest_feed_mm_min: float | None = None
    greatest_turn_deg_min: float | None = None
    acceleration_mm_s2: float | None = None

    @property
    def feed_limit_mm_min(self) -> float:
        """Greatest F of a move of the tool tip that is written [mm/min]."""
        return GREATEST_FEED_MM_MIN if self.greatest_feed_mm_min is None else self.greatest_feed_mm_min

    @property
    def planned_acceleration_mm_s2(self) -> float:
        """Acceleration by which pieces of moves are chosen [mm/s²]."""
        return ACCELERATION_MM_S2 if self.acceleration_mm_s2 is None else self.acceleration_mm_s2

    @property
    def turn_limit_deg_min(self) -> float:
        """Greatest F of a move that only turns [deg/min]."""
        return GREATEST_TURN_DEG_MIN if self.greatest_turn_deg_min is None else self.greatest_turn_deg_min
