"""Joints, travel, screws and masses of a hexapod."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.rotation import Rotation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats

STRUTS = 6

GREATEST_FEED_MM_MIN = 100_000.0
"""Greatest feed if the machine file states none [mm/min]: 100 m/min, the rapid of the fastest parallel machine tools.
It only keeps senseless numbers out of programs; the true limit belongs in the machine file."""

GREATEST_TURN_DEG_MIN = 36_000.0
"""Greatest feed of pure rotations if unstated: a hundred turns per minute [deg/min]."""

ACCELERATION_MM_S2 = 1000.0
"""Planned acceleration of the tool tip if the machine file states none [mm/s²]: 1 m/s², a tenth of gravity, low for
machine tools. Segments that keep their feed at this acceleration keep it at higher ones."""


@dataclass(frozen=True, eq=False)
class Hexapod:
    """Joints of a Stewart platform [CAL Fig 1], designed or actual.

    Attributes:
        base_joints_mm: Q, machine frame, shape (6, 3), or (n, 6, 3) if they move.
        platform_joints_mm: P, platform frame with origin at the tool tip, shape (6, 3) or (n, 6, 3).
        rotation: convention of tilt angles.
    """

    base_joints_mm: Floats
    platform_joints_mm: Floats
    rotation: Rotation = Rotation.XYZ

    def moved(self, base_mm: Floats, platform_mm: Floats) -> Hexapod:
        """Return the hexapod with shifted joints, shapes (6, 3) or (n, 6, 3) [mm]."""
        return replace(
            self,
            base_joints_mm=self.base_joints_mm + base_mm,
            platform_joints_mm=self.platform_joints_mm + platform_mm,
        )


@dataclass(frozen=True)
class Travel:
    """Limits as pairs (least, greatest)."""

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
    """Masses under gravity; None if unknown.

    Attributes:
        centre_of_gravity_above_tip_mm: on the platform's axis.
    """

    platform_kg: float
    centre_of_gravity_above_tip_mm: float


@dataclass(frozen=True)
class Compliance:
    """A strut's stretch under axial force, by design [GRAV eq 7].

    Attributes:
        at_1000mm_mm_per_n: for 1000 mm between joints.
        growing_share: proportional to length, as of a rod; the rest is constant [1].
    """

    at_1000mm_mm_per_n: float
    growing_share: float = 0.9


@dataclass(frozen=True)
class StrutMasses:
    """Masses of each strut on the line through its joints [GRAV Fig 2].

    Attributes:
        strut_kg: spread evenly between the joints.
        motor_kg: behind the base joint, turning with the strut.
        motor_length_mm: its centre is half this length behind the joint.
        screw_kg: ends at the platform joint and slides through the base joint.
        screw_length_mm: its rear end protrudes behind the base joint.
    """

    strut_kg: float
    motor_kg: float
    motor_length_mm: float
    screw_kg: float = 0.0
    screw_length_mm: float = 0.0


@dataclass(frozen=True, eq=False)
class JointAxes:
    """Directions of universal joints' axes in base and platform, of any length.

    The first axis is fixed in base or platform, the second in the strut, perpendicular to it.

    Attributes:
        base: machine frame, shape (6, 3) [1].
        platform: platform frame, shape (6, 3) [1].
    """

    base: Floats
    platform: Floats


@dataclass(frozen=True)
class ControlCorrection:
    """The control's own correction of its machine.

    Attributes:
        correction: `kinematics`, or `parameters` of a kinematics with tables.
        sources: values of the corrected error sources, by name and parameter.
    """

    correction: str
    model_sha256: str
    date: str
    sources: Mapping[str, Mapping[str, float]]

    @property
    def said(self) -> str:
        """Return the correction, in words."""
        return f"{self.correction} of the model {self.model_sha256[:12]} since {self.date}"


@dataclass(frozen=True, eq=False)
class Machine:
    """The nominal machine, as the controller assumes it.

    Attributes:
        reference_length_error_mm: corrected by the controller: it drives strut i to F_i(T) minus this error, shape (6,).
        joint_tolerance_mm: standard deviation of a base-joint coordinate after assembly; None if unknown.
        greatest_turn_deg_min: at a resting tool tip; None if unknown.
        acceleration_mm_s2: planned by the control; None if unknown.
        control: the control's own correction; None for a nominal control.
    """

    name: str
    hexapod: Hexapod
    travel: Travel
    reference_length_error_mm: Floats = field(default_factory=lambda: np.zeros(STRUTS))
    screw_lead_mm: float | None = None
    masses: Masses | None = None
    joint_tolerance_mm: float | None = None
    compliance: Compliance | None = None
    strut_masses: StrutMasses | None = None
    joint_axes: JointAxes | None = None
    greatest_feed_mm_min: float | None = None
    greatest_turn_deg_min: float | None = None
    acceleration_mm_s2: float | None = None
    control: ControlCorrection | None = None

    @property
    def feed_limit_mm_min(self) -> float:
        """Return the greatest F word for moves of the tool tip [mm/min]."""
        return GREATEST_FEED_MM_MIN if self.greatest_feed_mm_min is None else self.greatest_feed_mm_min

    @property
    def planned_acceleration_mm_s2(self) -> float:
        """Return the acceleration used to choose segment lengths [mm/s²]."""
        return ACCELERATION_MM_S2 if self.acceleration_mm_s2 is None else self.acceleration_mm_s2

    @property
    def turn_limit_deg_min(self) -> float:
        """Return the greatest F word for pure rotations [deg/min]."""
        return GREATEST_TURN_DEG_MIN if self.greatest_turn_deg_min is None else self.greatest_turn_deg_min
