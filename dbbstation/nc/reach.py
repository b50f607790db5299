"""Check a whole toolpath against the machine's travel and feeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MachineError
from dbbstation.machine.travel import check_travel, first_outside
from dbbstation.nc.toolpath import RowKind, in_pieces

if TYPE_CHECKING:
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
    for part in toolpath.in_order(machine.hexapod.rotation).parts():
        pieces = part.pieces(STEP_MM, STEP_DEG)
        block = np.cumsum(pieces) // AT_ONCE
        for rows in np.split(np.arange(len(part)), np.flatnonzero(np.diff(block)) + 1):
            row, share = in_pieces(pieces[rows])
            row = rows[row]
            poses = part.poses[row] if (share == 1.0).all() else part.between(row, share)
            known = part.is_move[row]
            row, poses = row[known], poses[known]
            if len(rows) and rows[0] == 0:
                # The pose before the first move; lines before that have no place.
                row, poses = np.append(np.argmax(part.is_move), row), np.vstack([part.before[:1], poses])
            outside, _ = first_outside(machine, poses)
            if outside < len(poses):
                where = part.where(int(row[outside]))
                check_travel(machine, poses[outside : outside + 1], where=where, remedy=DECLARED)


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
