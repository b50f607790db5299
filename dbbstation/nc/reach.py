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
    for part in toolpath.parts():
        pieces = part.pieces(STEP_MM, STEP_DEG)
        block = np.cumsum(pieces) // AT_ONCE
        for rows in np.split(np.arange(len(part)), np.flatnonzero(np.diff(block)) + 1):
            row, share = in_pieces(pieces[rows])
            _Poses(part, rows[row], share).check(machine, part)


def check_feeds(machine: Machine, toolpath: Toolpath) -> None:
    """Refuse feeds that the machine does not reach.

    Raises:
        MachineError: names program, line, feed and limit.
    """
    for part in toolpath.parts():
        turning, feed = part.only_turns, part.feed
        limit = np.where(turning, machine.turn_limit_deg_min, machine.feed_limit_mm_min)
        over = (part.kind == RowKind.FEED) & (feed > limit)
        if over.any():
            row = int(np.argmax(over))
            unit, key = ("deg/min", "greatest_turn_deg_min") if turning[row] else ("mm/min", "greatest_feed_mm_min")
            raise MachineError(
                f"the feed is {feed[row]:g} {unit}, the machine's greatest {limit[row]:g} {unit}",
                where=part.where(row),
                remedy=f"give a smaller F; its file states the limit as `{key}`",
            )


class _Poses:
    """Known poses within rows of a toolpath, its start first."""

    def __init__(self, toolpath: Toolpath, row: Integers, share: Floats) -> None:
        poses = toolpath.poses[row] if (share == 1.0).all() else toolpath.between(row, share)
        known = toolpath.is_move[row]
        self.row, self.poses = row[known], poses[known]
        if len(row) and row[0] == 0:
            # The pose before the first move; lines before that have no place.
            begins = int(np.argmax(toolpath.is_move))
            self.row, self.poses = np.concatenate([[begins], self.row]), np.vstack([toolpath.before[:1], self.poses])

    def check(self, machine: Machine, toolpath: Toolpath) -> None:
        """Refuse the first pose outside the travel, naming its line."""
        if _is_inside(machine, self.poses):
            return
        inside, outside = 0, len(self.poses) - 1
        while outside - inside > 0:
            middle = (inside + outside) // 2
            inside, outside = (
                (middle + 1, outside) if _is_inside(machine, self.poses[: middle + 1]) else (inside, middle)
            )
        where = toolpath.where(int(self.row[outside]))
        check_travel(machine, self.poses[outside : outside + 1], where=where, remedy=DECLARED)


def _is_inside(machine: Machine, poses: Floats) -> bool:
    try:
        check_travel(machine, poses, where="")
    except TravelError:
        return False
    return True
