"""A virtual machine with hidden errors whose struts LinuxCNC drives, and a circle of its tool."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.control.kinematics import component
from dbbstation.control.parameters import tool_errors
from dbbstation.files.places import package_text
from dbbstation.machine.geometry import Frames
from dbbstation.virtual.linuxcnc import installed_component

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

    from numpy.typing import NDArray

    from dbbstation.model.machine_model import MachineModel
    from dbbstation.virtual.linuxcnc import PlannerRun

NAME = "dbbtestkins"
"""A module that no shop has: it is installed for a test and taken away."""


def installed(model: MachineModel, folder: Path, digest: str = "0" * 64) -> AbstractContextManager[None]:
    """Build and install the component of a model; it is removed at the end."""
    made = component(model, package_text, NAME, digest)
    (folder / f"{NAME}.comp").write_text(made.text)
    return installed_component(folder / f"{NAME}.comp")


@dataclass(frozen=True)
class Circle:
    """The tool's circle on the real machine, least squares."""

    seconds: float
    centre_um: tuple[float, ...]
    roundness_um: float
    radius_um: float
    tilt_deg: float


def circle_program(radius_mm: float, tilt_deg: tuple[float, float], feed: float, z_mm: float) -> str:
    a, b = tilt_deg
    at = f"X{radius_mm} Y0 Z{z_mm} A{a} B{b} C0"
    return f"G21 G90 G94\nG64 P0.001\nG0 {at}\nG3 {at} I-{radius_mm} J0 F{feed}\nM2\n"


def circle_of(model: MachineModel, ran: PlannerRun, wanted: NDArray[np.float64], radius_mm: float) -> Circle:
    """The circle that the machine of a model makes of driven joints, about wanted centre and tilt, shape (6,)."""
    machine = model.machine
    near = np.tile(wanted, (len(ran.poses), 1))
    at = Frames.from_poses(near, machine.hexapod.rotation)
    off = tool_errors(model, ran.poses, at)
    tip = at.position_mm + off[:, :3]
    matrix = np.column_stack([2.0 * tip[:, :2], np.ones(len(tip))])
    x, y, c = np.linalg.lstsq(matrix, np.sum(tip[:, :2] ** 2, axis=1), rcond=None)[0]
    radius = np.hypot(tip[:, 0] - x, tip[:, 1] - y)
    tilt = float(np.degrees(np.linalg.norm(off[:, 3:], axis=1)).max())
    centre = 1e3 * np.array([x, y, tip[:, 2].mean()]) - 1e3 * wanted[:3]
    return Circle(
        ran.duration_s,
        tuple(centre.tolist()),
        1e3 * float(np.ptp(radius)),
        1e3 * float(np.sqrt(c + x * x + y * y) - radius_mm),
        tilt,
    )
