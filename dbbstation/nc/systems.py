"""Programs that count in several coordinate systems, compensated so that they stay right whatever the offsets between them.

A correction moves all six axes by some micrometres. An axis whose place was named in another system than the line counts in
cannot be corrected in that line: its number would mean another place, off by the offset between the two. So

- a rapid leaves such an axis where it is; nothing is cut on the way, and the next line that names it brings it right;
- a move at feed must be corrected in all axes. Where one of them is in another system, the program is right only where these
  systems are one: it gets a guard that stops it otherwise;
- so does one in which an increment (G91) moves an axis from a place that was named in another system: programs that are written
  name places, and this one has a number in no system.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.nc.toolpath import ACTIVE_SYSTEM, BY_INCREMENTS, MACHINE_SYSTEM, SYSTEMS, RowKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.toolpath import Toolpath


def in_systems(toolpath: Toolpath) -> Toolpath:
    """Return a compensated toolpath that stays right in several systems, or is guarded."""
    if not elsewhere(toolpath).any():
        return toolpath
    if not _mixed_feeds(toolpath).any() and not np.any(toolpath.frame[toolpath.is_move] == BY_INCREMENTS):
        return _held(toolpath)
    used = {
        *np.unique(toolpath.frame[toolpath.is_move]).tolist(),
        *np.unique(toolpath.system[toolpath.is_move]).tolist(),
    }
    named = tuple(SYSTEMS[system - 1] for system in sorted(used - {ACTIVE_SYSTEM, MACHINE_SYSTEM, BY_INCREMENTS}))
    return replace(toolpath, guard=tuple(sorted({*(toolpath.guard or ()), *named})))


def elsewhere(toolpath: Toolpath) -> NDArray[np.bool_]:
    """Return axes whose place was named in another system than the row counts in, shape (n, 6)."""
    apart: NDArray[np.bool_] = (toolpath.frame != toolpath.system[:, None]) & toolpath.is_move[:, None]
    return apart


def _mixed_feeds(toolpath: Toolpath) -> NDArray[np.bool_]:
    """Return moves at feed with an axis in another system, shape (n,)."""
    before = np.vstack([toolpath.frame[:1], toolpath.frame])[:-1]
    begins = (before != toolpath.system[:, None]).any(axis=1)
    return (toolpath.kind == RowKind.FEED) & (begins | elsewhere(toolpath).any(axis=1))


def _held(toolpath: Toolpath) -> Toolpath:
    """Return the toolpath with such axes held."""
    poses = toolpath.poses.copy()
    apart = elsewhere(toolpath)
    for axis in np.flatnonzero(apart.any(axis=0)):
        # Where an axis is held its last other place holds; before that it is where the program found it.
        own = np.where(apart[:, axis] | ~toolpath.is_move, -1, np.arange(len(poses)))
        place = np.maximum.accumulate(own)
        first = np.nan if toolpath.start is None else toolpath.start[axis]
        poses[:, axis] = np.where(place < 0, first, poses[place, axis])
    return replace(toolpath, poses=poses)
