"""The actual machine pose by pose, with nothing of dbbstation but its numbers: scipy's rotations and its root finder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.model.machine_model import MachineModel


def tool(truth: MachineModel, pose: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the tool tip is and how the platform stands, (3,) and (3, 3), under reference lengths and base joints."""
    errors = {fitted.source.name: fitted.values for fitted in truth.sources}
    base, platform = truth.machine.hexapod.base_joints_mm, truth.machine.hexapod.platform_joints_mm
    turn = Rotation.from_euler("XYZ", pose[3:], degrees=True)
    believed = np.linalg.norm(pose[:3] + turn.apply(platform) - base, axis=1)
    actual = believed - truth.machine.reference_length_error_mm + errors["strut-reference-length"]
    moved = base + errors["base-joints"].reshape(6, 3)

    def missing(x: NDArray[np.float64]) -> NDArray[np.float64]:
        there = pose[:3] + x[:3] + (Rotation.from_rotvec(x[3:] / 500.0) * turn).apply(platform)
        return np.linalg.norm(there - moved, axis=1) - actual

    found = least_squares(missing, np.zeros(6), xtol=3e-16, ftol=3e-16, gtol=3e-16)
    assert np.abs(found.fun).max() < 1e-9
    return pose[:3] + found.x[:3], (Rotation.from_rotvec(found.x[3:] / 500.0) * turn).as_matrix()
