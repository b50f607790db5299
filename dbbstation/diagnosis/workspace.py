"""Error over the workspace due to missing effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.reporting.figures import identified_model
from dbbstation.facts.value import finite
from dbbstation.inference.bounds import BOUNDS
from dbbstation.machine.travel import is_within_travel
from dbbstation.model.identified import position_uncertainty_mm, rms_length
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

REACH = 0.6
"""Compared share of the travel about its middle; the corners are hardly used."""

TILTS_DEG = ((0.0, 0.0), (15.0, 0.0), (-15.0, 0.0), (0.0, 15.0), (0.0, -15.0))


@dataclass(frozen=True)
class WorkspaceError:
    """Difference of tool position between the earlier calibration and the joint model, over the workspace.

    Attributes:
        error_greatest_um: greatest difference after subtracting the common shift.
        at_pose: pose of the greatest error, X, Y, Z, A, B, C [mm, deg].
        uncertainty_rms_um: rms standard uncertainty of the joint model without the common shift; None if unknown.
        common_shift_um: mean error along X, Y and Z, which a program's zero on the part removes.
        uncertainty_with_shift_rms_um: None if unknown.
    """

    error_rms_um: float
    error_greatest_um: float
    at_pose: tuple[float, ...]
    uncertainty_rms_um: float | None
    common_shift_um: tuple[float, ...]
    error_with_shift_rms_um: float
    uncertainty_with_shift_rms_um: float | None


def workspace_error(before: Calibration, after: Calibration) -> WorkspaceError | None:
    """Compare two calibrations of one machine over the workspace; None if no pose is within travel.

    Only sources that depend on the pose alone are compared, because drift and backlash have no fixed place.
    """
    machine = before.layout.machine
    poses = workspace(machine)
    if len(poses) == 0:
        return None
    motion = Motion(poses)
    was, now = (c.model.anywhere().actual_poses(motion)[:, :3] for c in (before, after))
    apart_um = 1e3 * (was - now)
    shift_um = apart_um.mean(axis=0)
    length_um = np.linalg.norm(apart_um - shift_um, axis=1)
    worst = int(np.argmax(length_um))
    identified = identified_model(after, {}, {})
    identified = replace(identified, model=identified.model.anywhere())
    own_um, own_with_shift_um = (
        1e3 * rms_length(position_uncertainty_mm(identified, motion, about_mean=about)) for about in (True, False)
    )
    return WorkspaceError(
        error_rms_um=rms_length(apart_um - shift_um),
        error_greatest_um=float(length_um[worst]),
        at_pose=tuple(poses[worst].tolist()),
        uncertainty_rms_um=finite(own_um),
        common_shift_um=tuple(shift_um.tolist()),
        error_with_shift_rms_um=rms_length(apart_um),
        uncertainty_with_shift_rms_um=finite(own_with_shift_um),
    )


def workspace(machine: Machine) -> Floats:
    """Return reachable poses over the inner travel, shape (n, 6) [mm, deg]."""
    travel = machine.travel
    middle = sum(travel.z_mm) / 2.0
    across = np.linspace(-REACH, REACH, BOUNDS.workspace_steps) * travel.xy_radius_mm
    up = middle + np.linspace(-REACH, REACH, BOUNDS.workspace_steps) * (travel.z_mm[1] - travel.z_mm[0]) / 2.0
    x, y, z, tilt = np.meshgrid(across, across, up, np.arange(len(TILTS_DEG)), indexing="ij")
    tilts = np.array(TILTS_DEG)[tilt.ravel()]
    poses = np.column_stack([x.ravel(), y.ravel(), z.ravel(), tilts, np.zeros(len(tilts))])
    inside = np.hypot(poses[:, 0], poses[:, 1]) <= REACH * travel.xy_radius_mm + 1e-9
    return poses[[row for row in np.flatnonzero(inside) if is_within_travel(machine, poses[row : row + 1])]]
