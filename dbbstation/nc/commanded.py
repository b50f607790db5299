"""Commanded poses of a recorded run whose program is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.nc.registry import dialect_of_file
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Rotation
    from dbbstation.model.observation import Observation
    from dbbstation.nc.toolpath import Toolpath
    from dbbstation.plan.plan import Circle

LARGEST_CORRECTION_MM = 5.0
"""A program that leaves the plan's circle by more than this belongs to another path."""

LARGEST_TILT_DEG = 2.0
"""The same for the platform's tilt."""

SLACK_DEG = 1.0
"""Largest difference of the arc's ends from the circle's ends: a compensated arc is not exactly as long as the circle."""


def commanded_poses(text: str, file: str, observation: Observation, order: Rotation | None = None) -> Floats:
    """Return the commanded poses of lead-in and samples, shape (n, 6) [mm, deg].

    Args:
        file: name with the dialect's extension.
        order: in which A, B and C of the machine turn; None: as in the program.

    Raises:
        InputError: the program cannot be read, or does not run this circle.
        StationError: no dialect has that extension, or several have it.
    """
    toolpath = dialect_of_file(file, text).toolpath(text, file)
    toolpath = toolpath if order is None else toolpath.in_order(order)
    phi_deg = np.concatenate([observation.lead_in_deg, observation.raw.phi_deg])
    return poses_at_progress(toolpath, observation.raw.circle, phi_deg)


def poses_at_progress(toolpath: Toolpath, circle: Circle, phi_deg: Floats) -> Floats:
    """Return commanded poses at the progress phi along the turn, shape (n, 6) [mm, deg].

    Phi is time at the plan's feed; 180 degrees is the middle between feed-in and feed-out. The arc is the program's
    longest stretch of feed moves without a stop.

    Args:
        phi_deg: negative in the lead-in, shape (n,) [deg].

    Raises:
        InputError: the program does not run this circle.
    """
    begin_s, end_s = _arc_s(toolpath)
    after_middle_s = (phi_deg - FULL_TURN_DEG / 2.0) / circle.turning_deg_s
    half_s = (end_s - begin_s) / 2.0
    missing_deg = (np.abs(after_middle_s).max(initial=0.0) - half_s) * circle.turning_deg_s
    if missing_deg > SLACK_DEG:
        what = (
            f"its longest move at feed takes {end_s - begin_s:.2f} s, {2.0 * missing_deg:.0f} degrees too little for "
            f"the circle at {circle.feed_mm_min:g} mm/min"
        )
        raise InputError.of(toolpath.name, what, "name the program that this run was made with")
    poses = toolpath.at_time(np.clip((begin_s + end_s) / 2.0 + after_middle_s, begin_s, end_s))
    _check_near(toolpath, poses, circle, phi_deg)
    return poses


def _arc_s(toolpath: Toolpath) -> tuple[float, float]:
    # Comments and functions take no time and end no stretch.
    stops = np.isin(toolpath.kind, [RowKind.RAPID, RowKind.DWELL, RowKind.PAUSE, RowKind.OPTIONAL_STOP])
    stretch = np.cumsum(stops)
    lasts = np.where(stops, 0.0, toolpath.duration_s)
    longest = int(np.argmax(np.bincount(stretch, weights=lasts)))
    rows = np.flatnonzero((stretch == longest) & ~stops)
    if len(rows) == 0:
        raise InputError.of(toolpath.name, "this program has no moves at feed", "name the run's program")
    end_s = toolpath.end_s
    return float(end_s[rows[0]] - lasts[rows[0]]), float(end_s[rows[-1]])


def _check_near(
    toolpath: Toolpath,
    poses: Floats,
    circle: Circle,
    phi_deg: Floats,
) -> None:
    off = poses - circle.poses(circle.theta_deg(phi_deg))
    off_mm = np.linalg.norm(off[:, :3], axis=1)
    off_deg = np.abs(off[:, 3:]).max(axis=1)
    for worst, most, unit in ((off_mm, LARGEST_CORRECTION_MM, "mm"), (off_deg, LARGEST_TILT_DEG, "degrees")):
        if worst.max(initial=0.0) > most:
            sample = int(np.argmax(worst))
            theta = float(circle.theta_deg(phi_deg[sample : sample + 1])[0] % FULL_TURN_DEG)
            what = f"it commands {worst[sample]:.3f} {unit} off the plan's circle at {theta:.1f} degrees"
            remedy = "name the program of this test and direction"
            raise InputError.of(toolpath.name, what, remedy)
