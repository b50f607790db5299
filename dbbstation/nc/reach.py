"""Check a whole toolpath against the machine's travel and feeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MachineError, TravelError
from dbbstation.machine.travel import check_travel
from dbbstation.nc.toolpath import RowKind, in_pieces

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.toolpath import Toolpath

STEP_MM = 2.0
STEP_DEG = 0.5
"""Spacing of checked poses. A strut may be shortest in the middle of a move; there its length changes by less than a micrometre over half a step."""

DECLARED = "move the path into the travel; or state work offsets and tool lengths of the control: undeclared ones count as zero"

AT_ONCE = 20_000
"""Poses that are checked together: ten megabytes."""


def check_reach(machine: Machine, toolpath: Toolpath) -> None:
    """Refuse a toolpath that leaves the travel of axes, angles or struts, also between points.

    Raises:
        TravelError: names program, line, pose and limit.
    """
    points = _Poses(toolpath, np.arange(len(toolpath)), np.ones(len(toolpath)))
    outside = points.first_outside(machine)
    upto = len(toolpath) if outside is None else int(points.row[outside]) + 1
    pieces = toolpath.pieces(STEP_MM, STEP_DEG)[:upto]
    # A move of one piece has no pose beside its end, which is a programmed point.
    divided = np.flatnonzero(pieces > 1)
    block = np.cumsum(pieces[divided]) // AT_ONCE
    for rows in np.split(divided, np.flatnonzero(np.diff(block)) + 1):
        row, share = in_pieces(pieces[rows])
        poses = _Poses(toolpath, rows[row], share)
        poses.refuse(machine, toolpath, poses.first_outside(machine))
    points.refuse(machine, toolpath, outside)


def check_feeds(machine: Machine, toolpath: Toolpath) -> None:
    """Refuse feeds that the machine does not reach.

    Raises:
        MachineError: names program, line, feed and limit.
    """
    turning = toolpath.only_turns
    limit = np.where(turning, machine.turn_limit_deg_min, machine.feed_limit_mm_min)
    over = (toolpath.kind == RowKind.FEED) & (toolpath.feed > limit)
    if not over.any():
        return
    row = int(np.argmax(over))
    unit, key = ("deg/min", "greatest_turn_deg_min") if turning[row] else ("mm/min", "greatest_feed_mm_min")
    raise MachineError(
        f"the feed is {toolpath.feed[row]:g} {unit}, the machine's greatest {limit[row]:g} {unit}",
        where=toolpath.where(row),
        remedy=f"give a smaller F; its file states the limit as `{key}`",
    )


class _Poses:
    """Known poses within rows of a toolpath, its start first."""

    def __init__(self, toolpath: Toolpath, row: Integers, share: Floats) -> None:
        poses = toolpath.between(row, share)
        known = toolpath.is_move[row]
        self.row, self.poses = row[known], poses[known]
        if len(row) and row[0] == 0:
            # The pose before the first move; lines before that have no place.
            begins = int(np.argmax(toolpath.is_move))
            self.row, self.poses = np.concatenate([[begins], self.row]), np.vstack([toolpath.before[:1], self.poses])

    def first_outside(self, machine: Machine) -> int | None:
        """Return the first pose outside the travel, or None."""
        if _is_inside(machine, self.poses):
            return None
        inside, outside = 0, len(self.poses)
        while outside - inside > 1:
            middle = (inside + outside) // 2
            if _is_inside(machine, self.poses[:middle]):
                inside = middle
            else:
                outside = middle
        return inside

    def refuse(self, machine: Machine, toolpath: Toolpath, outside: int | None) -> None:
        """Refuse a pose and name its line."""
        if outside is not None:
            where = toolpath.where(int(self.row[outside]))
            check_travel(machine, self.poses[outside : outside + 1], where=where, remedy=DECLARED)


def _is_inside(machine: Machine, poses: Floats) -> bool:
    try:
        for begin in range(0, len(poses), AT_ONCE):
            check_travel(machine, poses[begin : begin + AT_ONCE], where="")
    except TravelError:
        return False
    return True
