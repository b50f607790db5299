"""The toolpath of one ball-bar run: dwell, feed-in along the bar, overshoot, full turn, overshoot, feed-out, dwell."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.nc.toolpath import IN_FORCE, RowKind, Toolpath, ToolpathBuilder

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle

STEP_DEG = 0.1
"""Angle between programmed points: 3600 per turn [GRAV 4.1]."""

OUTER_DWELL_S = 1.0
"""Stop outside the circle: the recording must hold some samples before the feed-in."""

CORNER_DWELL_S = 0.3
"""Stop between feed-in and arc: the machine's vibration then does not blur the path's sharp corner."""

LEAST_CORNER_MM = 1e-4
"""The control may round the corners of the polygon by this much; 0.1 µm is below a bar's resolution."""

EVEN_RAD = 1e-9
"""Steps that differ by less are the same."""

BAR_ON = "put the bar on its balls, start recording, then continue"
BAR_OFF = "stop recording, take the bar off, then continue"


CLEARANCE_MM = 20.0
"""Height of rapids above the first and the last point, clear of ball, holder and bar."""


def circle_toolpath(
    circle: Circle,
    name: str,
    *,
    step_deg: float = STEP_DEG,
    clearance_mm: float | None = CLEARANCE_MM,
) -> Toolpath:
    """Return the nominal path of a run as straight moves every `step_deg`.

    Args:
        clearance_mm: height of the rapids, behind which the program waits for the bar; None: the bar stays on, and the
            program has only feed moves.
    """
    ends_deg = circle.theta_deg(np.array([-circle.overshoot_deg, FULL_TURN_DEG + circle.overshoot_deg]))
    first, last = circle.poses(ends_deg, circle.feed_in_mm)
    path = ToolpathBuilder(name)
    path.corner_mm = max(LEAST_CORNER_MM, chord_error_mm(circle, step_deg))
    path.holds = {IN_FORCE: (0.0,) * 6}
    if clearance_mm is not None:
        path.rapid(_raised(first, clearance_mm))
    path.feed(first[None], circle.feed_mm_min)
    if clearance_mm is not None:
        path.say(RowKind.PAUSE, BAR_ON)
    path.dwell(OUTER_DWELL_S)
    theta_deg = circle.theta_deg(arc_phi_deg(circle, step_deg))
    arc = circle.poses(theta_deg)
    path.feed(arc[:1], circle.feed_mm_min)
    path.dwell(CORNER_DWELL_S)
    x, y, _ = circle.centre_mm
    turned = np.diff(np.radians(theta_deg))
    # One step each on the overshoot and on the turn.
    parts = np.flatnonzero(np.abs(np.diff(turned)) > EVEN_RAD) + 1
    for poses, angles in zip(np.split(arc[1:], parts), np.split(turned, parts), strict=True):
        path.feed(poses, circle.feed_mm_min, arc=(x, y, float(angles.mean()), 0.0))
    path.dwell(CORNER_DWELL_S)
    path.feed(last[None], circle.feed_mm_min)
    path.dwell(OUTER_DWELL_S)
    if clearance_mm is not None:
        path.say(RowKind.PAUSE, BAR_OFF)
        path.rapid(_raised(last, clearance_mm))
    return path.built()


def arc_phi_deg(circle: Circle, step_deg: float) -> Floats:
    """Return the progress of the programmed points, overshoot arcs included [deg]."""
    edges = [-circle.overshoot_deg, 0.0, FULL_TURN_DEG, FULL_TURN_DEG + circle.overshoot_deg]
    parts = [np.array(edges[:1])]
    for start, stop in pairwise(edges):
        count = int(np.ceil((stop - start) / step_deg - 1e-9))
        parts.append(np.linspace(start, stop, count + 1)[1:])
    return np.concatenate(parts)


def chord_error_mm(circle: Circle, step_deg: float) -> float:
    """Return the distance of a chord's middle from the circle, r (1 - cos(step / 2)) [mm]."""
    return circle.radius_mm * float(1.0 - np.cos(np.radians(step_deg) / 2.0))


def _raised(pose: Floats, by_mm: float) -> Floats:
    return pose + np.array([0.0, 0.0, by_mm, 0.0, 0.0, 0.0])
