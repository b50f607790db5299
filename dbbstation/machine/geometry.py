"""Joints, travel, screws and masses of a hexapod, its rotations, differences of two machines, and a check of joints."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from dbbstation.computing.arrays import Floats
from dbbstation.errors import ModelError, StationError
from dbbstation.facts.quantities import LimitsDeg, LimitsMm, Mass, Quantity, sound
from dbbstation.facts.record import AsArray, Record, Sha256Hex
from dbbstation.text.written import listed

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


class Rotation(StrEnum):
    """Conventions by which A, B and C give R, from platform to machine vectors."""

    XYZ = "Rx(A) Ry(B) Rz(C)"
    ZYX = "Rz(C) Ry(B) Rx(A)"
    """The convention of LinuxCNC's `genhexkins`."""


@dataclass(frozen=True)
class Frames:
    """Poses as position and rotation matrix.

    Attributes:
        position_mm: tool tip, machine frame, shape (n, 3).
        rotation: platform axes in the machine frame, shape (n, 3, 3) [1].
    """

    position_mm: Floats
    rotation: Floats

    def __len__(self) -> int:
        return len(self.position_mm)

    @classmethod
    def from_poses(cls, poses: Floats, convention: Rotation) -> Frames:
        """Return frames of poses `[X, Y, Z, A, B, C]`, shape (n, 6) [mm, deg]."""
        return cls(np.ascontiguousarray(poses[:, :3]), rotation_matrices(poses[:, 3:], convention))

    def to_poses(self, convention: Rotation) -> Floats:
        """Return poses `[X, Y, Z, A, B, C]`, shape (n, 6) [mm, deg]; A and C within ±180, B within ±90 degrees."""
        return np.hstack([self.position_mm, tilt_angles(self.rotation, convention)])


def rotation_matrices(tilt_deg: Floats, convention: Rotation) -> Floats:
    """Return rotation matrices, shape (n, 3, 3), of A, B, C, shape (n, 3) [deg]."""
    # Rz(C) Ry(B) Rx(A) is the transpose of Rx(-A) Ry(-B) Rz(-C), so one product serves both conventions.
    sign = 1.0 if convention is Rotation.XYZ else -1.0
    tilt = np.radians(tilt_deg)
    cos_a, cos_b, cos_c = np.cos(tilt).T
    sin_a, sin_b, sin_c = sign * np.sin(tilt).T
    matrix = np.empty((len(tilt), 3, 3))
    product = matrix if convention is Rotation.XYZ else np.swapaxes(matrix, 1, 2)
    product[:, 0, 0] = cos_b * cos_c
    product[:, 0, 1] = -cos_b * sin_c
    product[:, 0, 2] = sin_b
    product[:, 1, 0] = cos_a * sin_c + sin_a * sin_b * cos_c
    product[:, 1, 1] = cos_a * cos_c - sin_a * sin_b * sin_c
    product[:, 1, 2] = -sin_a * cos_b
    product[:, 2, 0] = sin_a * sin_c - cos_a * sin_b * cos_c
    product[:, 2, 1] = sin_a * cos_c + cos_a * sin_b * sin_c
    product[:, 2, 2] = cos_a * cos_b
    return matrix


def tilt_angles(rotation: Floats, convention: Rotation) -> Floats:
    """Return A, B, C, shape (n, 3) [deg], of rotation matrices, shape (n, 3, 3)."""
    # Rx Ry Rz is the transpose of Rz(-C) Ry(-B) Rx(-A), so one extraction serves both conventions.
    sign = -1.0 if convention is Rotation.XYZ else 1.0
    r = np.swapaxes(rotation, 1, 2) if convention is Rotation.XYZ else rotation
    a = np.arctan2(r[:, 2, 1], r[:, 2, 2])
    b = np.arctan2(-r[:, 2, 0], np.hypot(r[:, 2, 1], r[:, 2, 2]))
    c = np.arctan2(r[:, 1, 0], r[:, 0, 0])
    return sign * np.degrees(np.column_stack([a, b, c]))


STRUTS = 6
STRUT_NUMBERS = range(1, STRUTS + 1)

GREATEST_FEED_MM_MIN = 100_000.0
"""Greatest feed if the machine file states none [mm/min]: 100 m/min, the rapid of the fastest parallel machine tools.
It only keeps senseless numbers out of programs; the true limit belongs in the machine file."""

GREATEST_TURN_DEG_MIN = 36_000.0
"""Greatest feed of pure rotations if unstated: a hundred turns per minute [deg/min]."""

ACCELERATION_MM_S2 = 1000.0
"""Planned acceleration of the tool tip if the machine file states none [mm/s²]: 1 m/s², a tenth of gravity, low for
machine tools. Segments that keep their feed at this acceleration keep it at higher ones."""


_Component = Annotated[float, Quantity("", 0, 1, signed=True)]

_UNIT_WITHIN = 0.01
"""Largest deviation of a unit vector's length from one in a file, which has two or three digits."""


def _no_direction(vector: tuple[float, float, float]) -> str:
    length = math.hypot(*vector)
    return f"a direction has the length 1, not {length:.3g}" if abs(length - 1.0) > _UNIT_WITHIN else ""


_Direction = Annotated[tuple[_Component, _Component, _Component], sound(_no_direction)]
_SIX_DIRECTIONS = AsArray(tuple[_Direction, _Direction, _Direction, _Direction, _Direction, _Direction])


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
class Travel(Record):
    """Limits of the machine; pairs are [least, greatest]."""

    xy_radius_mm: Annotated[float, Quantity("mm", 5, 10_000)]
    """Greatest distance of the tool tip from the Z axis [mm]."""
    x_mm: LimitsMm
    """X of the tool tip, machine frame [mm]."""
    y_mm: LimitsMm
    """Y of the tool tip, machine frame [mm]."""
    z_mm: LimitsMm
    """Z of the tool tip, machine frame, up positive [mm]."""
    a_deg: LimitsDeg
    """Tilt A about X [deg]."""
    b_deg: LimitsDeg
    """Tilt B about Y [deg]."""
    c_deg: LimitsDeg
    """Turn C about Z [deg]."""
    strut_mm: LimitsMm
    """Length of a strut between its joints [mm]."""


@dataclass(frozen=True)
class Masses(Record):
    """Masses that gravity acts on."""

    platform_kg: Annotated[float, Quantity("kg", 1, 100_000)]
    """Platform with spindle and tool [kg]."""
    centre_of_gravity_above_tip_mm: Annotated[float, Quantity("mm", 5, 5_000, or_zero=True, signed=True)]
    """Height of the platform's centre of gravity above the tool tip, along the platform's axis, up positive [mm]."""


@dataclass(frozen=True)
class Compliance(Record):
    """How much a strut stretches under an axial force, by design."""

    at_1000mm_mm_per_n: Annotated[float, Quantity("mm/N", 1e-9, 1e-2)]
    """Elongation per force of a strut of 1000 mm between its joints, pulling positive [mm/N]."""
    growing_share: Annotated[float, Quantity("", 0, 1)] = 0.9
    """Share of this elongation that grows with the strut's length; the remaining share is constant [1]."""


@dataclass(frozen=True)
class StrutMasses(Record):
    """Masses of each of the six struts, on the line through its joints."""

    strut_kg: Mass
    """Mass that is spread evenly between base joint and platform joint at every length [kg]."""
    motor_kg: Mass
    """Mass behind the base joint that turns with the strut [kg]."""
    motor_length_mm: Annotated[float, Quantity("mm", 5, 5_000, or_zero=True)]
    """Length of that part; its centre is half of it behind the joint [mm]."""
    screw_kg: Mass = 0.0
    """Screw that ends at the platform joint and slides through the base joint [kg]."""
    screw_length_mm: Annotated[float, Quantity("mm", 5, 10_000, or_zero=True)] = 0.0
    """Length of that screw; its rear end sticks out behind the joint [mm]."""


@dataclass(frozen=True, eq=False)
class JointAxes(Record):
    """Axes of the universal joints of struts 1 to 6 that are fixed in base and platform, as unit vectors.

    The second axis of each joint is fixed in the strut, across it.
    """

    base: Annotated[Floats, _SIX_DIRECTIONS]
    """Of the base joints, machine frame [1]."""
    platform: Annotated[Floats, _SIX_DIRECTIONS]
    """Of the platform joints, platform frame [1]."""


@dataclass(frozen=True)
class ControlCorrection(Record):
    """Corrections of the control itself, as `dbbstation control` writes them."""

    correction: Literal["kinematics", "parameters"]
    """A kinematics made of a model, or parameters and tables for the control's own kinematics."""
    model_sha256: Sha256Hex
    """SHA-256 of the model file that it was made from."""
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
    """Date of the correction."""
    sources: Mapping[str, Mapping[str, float]]
    """Corrected error sources by name, with their parameters in the sources' units."""

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


DESCRIPTION = frozenset({"name", "control"})
"""Keys that do not describe the nominal machine; a control's correction counts as part of the commands."""

NOT_PREDICTED = frozenset({"travel", "joint_tolerance_mm", "acceleration_mm_s2"})
"""Keys that no prediction of a calibrated model uses: limits of motion, and prior standard deviations of a fit."""

CONTROL = frozenset({"base_joints_mm", "platform_joints_mm", "rotation", "reference_length_error_mm"})
"""Keys that every prediction uses, because the control computes strut lengths from them."""

NOT_GIVEN = "not given"

ROUNDED_MM = 1e-6
"""Smaller differences of joints and lengths are rounding: a nanometre, which no test resolves [mm]."""


@dataclass(frozen=True)
class Difference:
    """One differing value."""

    key: str
    one: str
    other: str

    @property
    def text(self) -> str:
        """Return key and both values."""
        return f"{self.key} {self.one} and {self.other}"

    @property
    def first_key(self) -> str:
        """Return the top-level key of the machine file."""
        return self.key.partition(".")[0].partition(" ")[0]


def differences(one: Machine, other: Machine) -> tuple[Difference, ...]:
    """Return every difference beyond a nanometre, except names."""
    return tuple(found for found in _between("", one, other) if found.first_key not in DESCRIPTION)


def in_words(found: Sequence[Difference], most: int = 4) -> str:
    """Return the first differences in words, with the count of others."""
    return listed([difference.text for difference in found], most, between="; ")


def check_model_is_of(machine: Machine, calibrated: Machine) -> None:
    """Refuse a model of another machine.

    Raises:
        ModelError: names differences with both values.
    """
    found = [
        difference
        for difference in differences(calibrated, machine)
        if difference.first_key not in NOT_PREDICTED
        and (difference.first_key in CONTROL or NOT_GIVEN not in {difference.one, difference.other})
    ]
    if found:
        what = f"the model was calibrated on another nominal machine ({calibrated.name}) than {machine.name}"
        raise ModelError(
            f"{what}: {in_words(found)}",
            remedy="use the model of this machine, or the machine file that the model's sessions were recorded with",
        )


def refuse_second_correction(machine: Machine) -> None:
    """Refuse to compensate programs if the control corrects the machine itself.

    Raises:
        StationError: names the control's correction.
    """
    if machine.control is not None:
        raise StationError(
            f"the control of {machine.name!r} corrects the machine already: {machine.control.said}",
            remedy="run nominal programs; or take the correction out of the control, and `control` out of the machine file",
        )


def _between(key: str, one: object, other: object) -> Iterator[Difference]:
    if is_dataclass(one) and type(one) is type(other):
        for field in fields(one):
            # The machine file has the joints at its top.
            inner = "" if isinstance(getattr(one, field.name), Hexapod) else field.name
            yield from _between(
                ".".join(filter(None, (key, inner))), getattr(one, field.name), getattr(other, field.name)
            )
    elif isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and len(one) == len(other) == STRUTS:
        for strut, (a, b) in enumerate(zip(one, other, strict=True), start=1):
            if not np.allclose(a, b, rtol=0.0, atol=ROUNDED_MM):
                yield Difference(f"{key} of strut {strut}", _said(a.tolist()), _said(b.tolist()))
    elif one != other:
        yield Difference(key, _said(one), _said(other))


def _said(value: object) -> str:
    if value is None:
        return NOT_GIVEN
    if is_dataclass(value):
        inside = "; ".join(f"{field.name} {_said(getattr(value, field.name))}" for field in fields(value))
        return f"({inside})"
    return str(np.asarray(value).tolist() if isinstance(value, tuple | np.ndarray) else value)


REGULAR_MM = 0.05
"""Sides of an equilateral design, written with one decimal, agree within this [mm]. Three joints of another design,
half a metre apart, agree by chance once in (500 / 0.05)², a hundred million."""

OFF_MM = 1.0
"""Rounding cannot make sides differ by more [mm]."""


def check_joints(machine: Machine) -> None:
    """Refuse a machine if three of its joints are regular and the other three are not.

    Machines with all joints regular, or all irregular, are accepted.

    Raises:
        ModelError: names the joint, or its triplet, and the deviation.
    """
    for key in ("base_joints_mm", "platform_joints_mm"):
        joints = np.asarray(getattr(machine.hexapod, key))
        for one, other in (((0, 2, 4), (1, 3, 5)), ((1, 3, 5), (0, 2, 4))):
            sides = _sides_mm(joints[list(other)])
            if np.ptp(_sides_mm(joints[list(one)])) <= REGULAR_MM and np.ptp(sides) > OFF_MM:
                raise ModelError(
                    f"{key}: {_which(joints, one, other)}, while those of struts "
                    f"{', '.join(str(strut + 1) for strut in one)} are exactly regular",
                    where=machine.name,
                    remedy="correct the joint in the model file's `machine`, or calibrate again with the right machine file",
                )


def _which(joints: Floats, regular: tuple[int, ...], other: tuple[int, ...]) -> str:
    centre = joints[list(regular)].mean(axis=0)
    first, second = joints[regular[1]] - joints[regular[0]], joints[regular[2]] - joints[regular[0]]
    axis = np.cross(first, second)
    axis /= np.linalg.norm(axis)
    for place, strut in enumerate(other):
        after, before = other[(place + 1) % 3], other[(place + 2) % 3]
        for turn in (1.0, -1.0):
            expected = _turned(joints[before] - centre, axis, turn) + centre
            again = _turned(joints[after] - centre, axis, -turn) + centre
            if np.linalg.norm(expected - again) <= OFF_MM:
                off_mm = float(np.linalg.norm(joints[strut] - expected))
                return f"the joint of strut {strut + 1} is {off_mm:.1f} mm from where those of the other struts put it"
    sides = ", ".join(f"{side:.1f}" for side in _sides_mm(joints[list(other)]))
    return f"the joints of struts {', '.join(str(strut + 1) for strut in other)} are {sides} mm apart"


def _sides_mm(triangle: Floats) -> Floats:
    return np.linalg.norm(triangle - np.roll(triangle, 1, axis=0), axis=1)


def _turned(vector: Floats, axis: Floats, turn: float) -> Floats:
    angle = turn * 2.0 * np.pi / 3.0
    along = axis * (axis @ vector)
    return along + (vector - along) * np.cos(angle) + np.cross(axis, vector) * np.sin(angle)
