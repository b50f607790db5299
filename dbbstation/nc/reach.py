"""Whether the machine can run a whole toolpath, between its programmed points as well."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TravelError
from dbbstation.machine.travel import check_travel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.toolpath import Toolpath

STEP_MM = 2.0
STEP_DEG = 0.5
"""Spacing of the poses that are checked: struts are shortest somewhere in the middle of a move, where they change by
less than a micrometre over half a step."""


def check_reach(machine: Machine, toolpath: Toolpath) -> None:
    """Refuse a toolpath that leaves the travel of axes, angles or struts anywhere on its way.

    Raises:
        TravelError: names program, line, pose and limit.
    """
    row, share = toolpath.subdivided(STEP_MM, STEP_DEG)
    poses = toolpath.between(row, share)
    known = ~np.isnan(poses[:, 0]) & toolpath.is_move[row]
    row, poses = row[known], poses[known]
    if toolpath.start is not None:
        row, poses = np.concatenate([[0], row]), np.vstack([toolpath.start, poses])
    if _is_inside(machine, poses):
        return
    inside, outside = 0, len(poses)
    while outside - inside > 1:
        middle = (inside + outside) // 2
        if _is_inside(machine, poses[:middle]):
            inside = middle
        else:
            outside = middle
    line = int(toolpath.line[row[inside]])
    check_travel(machine, poses[inside:outside], where=f"{toolpath.name}:{line}" if line else toolpath.name)


def _is_inside(machine: Machine, poses: NDArray[np.float64]) -> bool:
    try:
        check_travel(machine, poses, where="")
    except TravelError:
        return False
    return True
