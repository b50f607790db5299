"""A virtual machine with hidden errors whose struts LinuxCNC drives, and a circle of its tool."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.control.kinematics import component
from dbbstation.control.parameters import Values, hal_lines, home_mm, tables, tool_errors
from dbbstation.files.shipped import package_text
from dbbstation.machine.kinematics import strut_lengths
from dbbstation.machine.rotation import Frames
from dbbstation.model.machine_model import MachineModel
from tests.nc.planner.linuxcnc import Kins, missing

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from tests.nc.planner.linuxcnc import Ran

NAME = "dbbtestkins"
"""A module that no shop has: it is installed for a test and taken away."""


def lacking() -> str:
    """Why LinuxCNC cannot be given a kinematics here; empty if it can."""
    if shutil.which("halcompile") is None:
        return "halcompile is not installed: package linuxcnc-uspace-dev"
    return missing() or ("" if os.getuid() == 0 else "only root installs a module of LinuxCNC")


def installed(model: MachineModel, folder: Path, digest: str = "0" * 64) -> Path:
    """Build and install the component of a model; return the module, which the caller removes."""
    made = component(model, package_text("control/kernel.c"), NAME, digest)
    (folder / f"{NAME}.comp").write_text(made.text)
    done = subprocess.run(
        ["halcompile", "--install", f"{NAME}.comp"],  # noqa: S607 - as LinuxCNC has it
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "warning" not in done.stderr
    return Path(f"/usr/lib/linuxcnc/modules/{NAME}.so")


def middle_mm(machine: Machine) -> float:
    return sum(machine.travel.z_mm) / 2.0


def home_of(machine: Machine) -> NDArray[np.float64]:
    """Driven lengths in the middle of the travel, where the machine is switched on, shape (6,) [mm]."""
    pose = np.array([[0.0, 0.0, sum(machine.travel.z_mm) / 2.0, 0.0, 0.0, 0.0]])
    frames = Frames.from_poses(pose, machine.hexapod.rotation)
    return (strut_lengths(machine.hexapod, frames) - machine.reference_length_error_mm)[0]


def our_kins(machine: Machine) -> Kins:
    return Kins(
        NAME, home_of(machine), np.zeros(6), middle_mm(machine), (f"net on motion.motion-enabled => {NAME}.enabled",)
    )


def genhexkins(machine: Machine, values: Values | None) -> Kins:
    """LinuxCNC's own, with nominal joints or refitted values."""
    points = np.array(machine.travel.strut_mm)
    none = np.zeros((6, 3))
    nominal = Values(none, none, machine.reference_length_error_mm, points, np.zeros((6, 2)))
    of = values or nominal
    return Kins(
        "genhexkins",
        home_of(machine),
        machine.reference_length_error_mm + home_mm(of, machine),
        middle_mm(machine),
        hal_lines(of, machine),
        tables(of, np.zeros(6)),
    )


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


def circle_of(model: MachineModel, ran: Ran, wanted: NDArray[np.float64], radius_mm: float) -> Circle:
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
