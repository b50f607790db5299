"""`dbb-machine/1`: the nominal machine, as its controller believes it."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from dbbstation.computing.arrays import Floats
from dbbstation.errors import Problem
from dbbstation.facts.quantities import JointMm, LimitsDeg, LimitsMm, Quantity
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Schema, format_of, read_document, validate
from dbbstation.machine.geometry import (
    Compliance,
    ControlCorrection,
    Hexapod,
    JointAxes,
    Machine,
    Masses,
    StrutMasses,
    Travel,
)
from dbbstation.machine.rotation import Rotation

_Millimetre = Annotated[float, Quantity("mm", 0, 20, signed=True)]
_Component = Annotated[float, Quantity("", 0, 1, signed=True)]

_UNIT_WITHIN = 0.01
"""How far the length of a direction may be from one, written with two or three digits."""


def _direction(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    length = math.hypot(*vector)
    if abs(length - 1.0) > _UNIT_WITHIN:
        raise PydanticCustomError(
            "direction", "a direction has the length 1, not {length}", {"length": f"{length:.3g}"}
        )
    return vector


_Direction = Annotated[tuple[_Component, _Component, _Component], AfterValidator(_direction)]


class TravelSchema(Schema):
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


class MassesSchema(Schema):
    """What gravity acts on."""

    platform_kg: Annotated[float, Quantity("kg", 1, 100_000)]
    """Platform with spindle and tool [kg]."""
    centre_of_gravity_above_tip_mm: Annotated[float, Quantity("mm", 5, 5_000, or_zero=True, signed=True)]
    """Height of the platform's centre of gravity above the tool tip, along the platform's axis, up positive [mm]."""


class ComplianceSchema(Schema):
    """How much a strut stretches under an axial force, by design."""

    at_1000mm_mm_per_n: Annotated[float, Quantity("mm/N", 1e-9, 1e-2)]
    """Elongation per force of a strut of 1000 mm between its joints, pulling positive [mm/N]."""
    growing_share: Annotated[float, Quantity("", 0, 1)] = 0.9
    """Part of that which grows with the strut's length; the rest is the same at every length [1]."""


class StrutMassesSchema(Schema):
    """Masses of each of the six struts, on the line through its joints."""

    strut_kg: Annotated[float, Quantity("kg", 0, 2_000)]
    """Mass that is spread evenly between base joint and platform joint at every length [kg]."""
    motor_kg: Annotated[float, Quantity("kg", 0, 2_000)]
    """Mass behind the base joint that turns with the strut [kg]."""
    motor_length_mm: Annotated[float, Quantity("mm", 5, 5_000, or_zero=True)]
    """Length of that part; its centre is half of it behind the joint [mm]."""
    screw_kg: Annotated[float, Quantity("kg", 0, 2_000)] = 0.0
    """Screw that ends at the platform joint and slides through the base joint [kg]."""
    screw_length_mm: Annotated[float, Quantity("mm", 5, 10_000, or_zero=True)] = 0.0
    """Length of that screw; its rear end sticks out behind the joint [mm]."""


class JointAxesSchema(Schema):
    """Axes of the universal joints of struts 1 to 6 that are fixed in base and platform, as unit vectors."""

    base: tuple[_Direction, _Direction, _Direction, _Direction, _Direction, _Direction]
    """Of the base joints, machine frame [1]."""
    platform: tuple[_Direction, _Direction, _Direction, _Direction, _Direction, _Direction]
    """Of the platform joints, platform frame [1]."""


class ControlSchema(Schema):
    """Corrections of the control itself, as `dbbstation control` writes them."""

    correction: Literal["kinematics", "parameters"]
    """A kinematics made of a model, or parameters and tables for the control's own kinematics."""
    model_sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """SHA-256 of the model file that it was made from."""
    date: Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$")]
    """Date of the correction."""
    sources: dict[str, dict[str, float]]
    """Corrected error sources by name, with their parameters in the sources' units."""


class MachineParts(Schema):
    """The machine: the content of a machine file without its `format` line, also inline in models."""

    name: Annotated[str, Field(min_length=1)]
    """Name of the machine."""
    rotation: Literal["Rx(A) Ry(B) Rz(C)", "Rz(C) Ry(B) Rx(A)"]
    """Rotation of platform axes into machine axes by the tilt angles; LinuxCNC's genhexkins uses the second."""
    base_joints_mm: tuple[JointMm, JointMm, JointMm, JointMm, JointMm, JointMm]
    """Centres of the base joints of struts 1 to 6, machine frame, Z up [mm]."""
    platform_joints_mm: tuple[JointMm, JointMm, JointMm, JointMm, JointMm, JointMm]
    """Centres of the platform joints of struts 1 to 6, platform frame with its origin at the tool tip [mm]."""
    reference_length_error_mm: tuple[_Millimetre, _Millimetre, _Millimetre, _Millimetre, _Millimetre, _Millimetre] = (
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    """Strut errors that the controller already corrects: it drives strut i to F_i(T) minus this value; positive if the
    strut is longer than the controller assumed [mm]."""
    travel: TravelSchema
    """Limits that plans and programs are checked against."""
    screw_lead_mm: Annotated[float, Quantity("mm", 0.5, 200)] | None = None
    """Travel of a strut per turn of its screw [mm]."""
    joint_tolerance_mm: Annotated[float, Quantity("mm", 1e-4, 10)] | None = None
    """Standard deviation of each base-joint coordinate after assembly [mm]; without it no weak direction of a
    calibration is regularised."""
    greatest_feed_mm_min: Annotated[float, Quantity("mm/min", 100, 500_000)] | None = None
    """Greatest feed of the tool tip [mm/min]; programs with a larger F are refused. Without it 100000."""
    greatest_turn_deg_min: Annotated[float, Quantity("deg/min", 10, 500_000)] | None = None
    """Greatest speed of the tilt angles [deg/min], for the F of moves that only turn. Without it 36000."""
    acceleration_mm_s2: Annotated[float, Quantity("mm/s²", 50, 50_000)] | None = None
    """Acceleration of the tool tip that the control plans with [mm/s²], for the pieces of compensated programs. Without
    it 1000."""
    masses: MassesSchema | None = None
    """Masses that gravity acts on, for the sources that model gravity."""
    compliance: ComplianceSchema | None = None
    """Design compliance of the struts, for the sources that model gravity."""
    strut_masses: StrutMassesSchema | None = None
    """Weight of struts and motors, for the source that models it."""
    joint_axes: JointAxesSchema | None = None
    """Axes of the universal joints, for the source that models how they turn the screws."""
    control: ControlSchema | None = None
    """Corrections of the control itself; absent if it uses the nominal machine."""

    def to_domain(self) -> Machine:
        """Return the machine that calculations use."""
        masses, compliance, strut_masses = self.masses, self.compliance, self.strut_masses
        axes, control = self.joint_axes, self.control
        return Machine(
            name=self.name,
            hexapod=Hexapod(
                np.array(self.base_joints_mm, dtype=np.float64),
                np.array(self.platform_joints_mm, dtype=np.float64),
                Rotation(self.rotation),
            ),
            travel=Travel(**self.travel.model_dump()),
            reference_length_error_mm=np.array(self.reference_length_error_mm, dtype=np.float64),
            screw_lead_mm=self.screw_lead_mm,
            masses=None if masses is None else Masses(**masses.model_dump()),
            joint_tolerance_mm=self.joint_tolerance_mm,
            compliance=None if compliance is None else Compliance(**compliance.model_dump()),
            strut_masses=None if strut_masses is None else StrutMasses(**strut_masses.model_dump()),
            joint_axes=None if axes is None else JointAxes(np.array(axes.base), np.array(axes.platform)),
            greatest_feed_mm_min=self.greatest_feed_mm_min,
            greatest_turn_deg_min=self.greatest_turn_deg_min,
            acceleration_mm_s2=self.acceleration_mm_s2,
            control=None if control is None else ControlCorrection(**control.model_dump()),
        )


def machine_parts(machine: Machine) -> MachineParts:
    """Return a machine in the form of files, the exact inverse of `MachineParts.to_domain`."""

    def points(joints: Floats) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(joint) for joint in joints.tolist())

    return MachineParts.model_validate(
        {
            "name": machine.name,
            "rotation": machine.hexapod.rotation.value,
            "base_joints_mm": points(machine.hexapod.base_joints_mm),
            "platform_joints_mm": points(machine.hexapod.platform_joints_mm),
            "reference_length_error_mm": tuple(machine.reference_length_error_mm.tolist()),
            "travel": asdict(machine.travel),
            "screw_lead_mm": machine.screw_lead_mm,
            "joint_tolerance_mm": machine.joint_tolerance_mm,
            "greatest_feed_mm_min": machine.greatest_feed_mm_min,
            "greatest_turn_deg_min": machine.greatest_turn_deg_min,
            "acceleration_mm_s2": machine.acceleration_mm_s2,
            "masses": machine.masses and asdict(machine.masses),
            "compliance": machine.compliance and asdict(machine.compliance),
            "strut_masses": machine.strut_masses and asdict(machine.strut_masses),
            "joint_axes": machine.joint_axes
            and {"base": points(machine.joint_axes.base), "platform": points(machine.joint_axes.platform)},
            "control": machine.control and asdict(machine.control),
        }
    )


def machine_text(machine: Machine) -> str:
    """Return the text of a machine's file."""
    data = machine_data(machine_parts(machine))
    return yaml_text({"format": format_of(MachineFile), **data})


def machine_data(parts: MachineParts) -> dict[str, object]:
    """Return the keys of a machine in the format's order, without empty ones."""
    return parts.model_dump(exclude_none=True, exclude={"format"})


class MachineFile(MachineParts):
    """The nominal machine of the controller: joints, travel, screws, masses."""

    format: Literal["dbb-machine/1"]
    """Name and version of this format."""


def read_machine(path: Path) -> Machine:
    """Read a machine file.

    Raises:
        InputError: every fault with its place.
    """
    parts = without_faults(lambda faults: parse_machine(path, faults))
    return parts.to_domain()


def parse_machine(path: Path, faults: list[Problem]) -> MachineFile | None:
    """Read a machine file; None with faults added to `faults`."""
    document = read_document(path, MachineFile, faults)
    return None if document is None else validate(document, MachineFile, faults)
