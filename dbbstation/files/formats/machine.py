"""`dbb-machine/1`: the nominal machine: the geometry that its controller uses."""

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from dbbstation.computing.arrays import Floats
from dbbstation.errors import Problem
from dbbstation.facts.quantities import JointMm, Quantity, Text
from dbbstation.facts.record import AsArray
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Schema, format_of, read_document, validate
from dbbstation.machine.geometry import (
    STRUTS,
    Compliance,
    ControlCorrection,
    Hexapod,
    JointAxes,
    Machine,
    Masses,
    Rotation,
    StrutMasses,
    Travel,
)

_Millimetre = Annotated[float, Quantity("mm", 0, 20, signed=True)]
_SIX_JOINTS = AsArray(tuple[JointMm, JointMm, JointMm, JointMm, JointMm, JointMm])
_SIX_LENGTHS = AsArray(tuple[_Millimetre, _Millimetre, _Millimetre, _Millimetre, _Millimetre, _Millimetre])


class MachineParts(Schema):
    """The machine: the content of a machine file without its `format` line, also inline in models."""

    name: Text
    """Name of the machine."""
    rotation: Literal["Rx(A) Ry(B) Rz(C)", "Rz(C) Ry(B) Rx(A)"]
    """Rotation of platform axes into machine axes by the tilt angles; LinuxCNC's genhexkins uses the second."""
    base_joints_mm: Annotated[Floats, _SIX_JOINTS]
    """Centres of the base joints of struts 1 to 6, machine frame, Z up [mm]."""
    platform_joints_mm: Annotated[Floats, _SIX_JOINTS]
    """Centres of the platform joints of struts 1 to 6, platform frame with its origin at the tool tip [mm]."""
    reference_length_error_mm: Annotated[Floats, _SIX_LENGTHS] = Field(default_factory=lambda: np.zeros(STRUTS))
    """Strut errors that the controller already corrects: it drives strut i to F_i(T) minus this value; positive if the
    strut is longer than the controller assumed [mm]."""
    travel: Travel
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
    masses: Masses | None = None
    """Masses that gravity acts on, for the sources that model gravity."""
    compliance: Compliance | None = None
    """Design compliance of the struts, for the sources that model gravity."""
    strut_masses: StrutMasses | None = None
    """Weight of struts and motors, for the source that models it."""
    joint_axes: JointAxes | None = None
    """Axes of the universal joints, for the source that models how they turn the screws."""
    control: ControlCorrection | None = None
    """Corrections of the control itself; absent if it uses the nominal machine."""

    def to_domain(self) -> Machine:
        """Return the machine that calculations use."""
        hexapod = Hexapod(self.base_joints_mm, self.platform_joints_mm, Rotation(self.rotation))
        return Machine(hexapod=hexapod, **{name: getattr(self, name) for name in _ALIKE})


_ALIKE = tuple(one.name for one in fields(Machine) if one.name != "hexapod")


def machine_text(machine: Machine) -> str:
    """Return the text of a machine's file."""
    return yaml_text({"format": format_of(MachineFile), **machine_data(machine)})


def machine_data(machine: Machine) -> dict[str, object]:
    """Return the keys of a machine in the format's order, without empty ones; the inverse of `MachineParts.to_domain`."""
    own: Any = {name: getattr(machine, name) for name in _ALIKE}
    joints = vars(machine.hexapod) | {"rotation": machine.hexapod.rotation.value}
    return MachineParts.model_validate(joints | own).model_dump(exclude_none=True)


class MachineFile(MachineParts):
    """The nominal machine of the controller: joints, travel, screws, masses."""

    format: Literal["dbb-machine/1"]
    """Name and version of this format."""


def read_machine(path: Path) -> Machine:
    """Read a machine file.

    Raises:
        InputError: every fault with its place.
    """
    parts = without_faults(parse_machine, path)
    return parts.to_domain()


def parse_machine(path: Path, faults: list[Problem]) -> MachineFile | None:
    """Read a machine file; None with faults added to `faults`."""
    document = read_document(path, MachineFile, faults)
    return None if document is None else validate(document, MachineFile)
