"""Short moves that LinuxCNC's naive CAM detector merges under `G64 P Q`.

Successive lines become one straight move while all points lie within Q of it (P without Q). An arc in X and Y that leaves
its chord by less than Q first becomes two lines. Moves that turn A, B or C stay [LinuxCNC 2.9, `linkable`, `see_segment`
and `ARC_FEED` in `src/emc/task/emccanon.cc`].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled
from dbbstation.nc.splitting import moves_of
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.nc.toolpath import Toolpath

MOST_POINTS = 101
"""Points of lines that become one at most: a line is taken in while there are no more than a hundred (`linkable`)."""


@dataclass(frozen=True, eq=False)
class Queued:
    """A toolpath as a control queues it, k rows.

    Attributes:
        path: with one row for merged moves; words between them come first.
        of: row of `path` for each row of the program, shape (n,).
        share: of the time of that row, shape (n,).
        off_mm: greatest distance of a left-out point from its line.
    """

    path: Toolpath
    of: NDArray[np.int64]
    share: NDArray[np.float64]
    off_mm: float


def queued(toolpath: Toolpath) -> Queued | None:
    """Return the moves as a control queues them; None if none are merged."""
    within_mm = toolpath.merges_mm
    if not (within_mm > 0.0).any():
        return None
    feed, turns = toolpath.kind == RowKind.FEED, toolpath.turn_deg > 0.0
    arc = np.zeros((len(toolpath), 3)) if toolpath.arc is None else toolpath.arc
    straightened, points = _short_arcs(toolpath, arc, within_mm)
    straight = feed & ~turns & ((arc[:, 2] == 0.0) | straightened)
    # A work system that is in force already changes nothing.
    same = toolpath.system[1:] == toolpath.system[:-1]
    says = (toolpath.kind == RowKind.COMMENT) | ((toolpath.kind == RowKind.SYSTEM) & np.append(False, same))
    ends = ~says & ~straight
    at = np.flatnonzero(straight & (~straightened | points))
    if len(at) == 0:
        return None
    # What stands between two moves sends the first one on its way.
    between = np.cumsum(~says & ~straight)[at]
    new = np.append(True, (np.diff(between) > 0) | (np.diff(toolpath.feed_mm_min[at]) != 0.0))
    new[1:] |= within_mm[at[1:]] != within_mm[at[:-1]]
    ends[at[_chain_ends(toolpath.poses[at, :3], toolpath.before[_begins(at, straight), :3], within_mm[at], new)]] = True
    if ends[straight].all():
        return None
    kept, last = ends | says, np.flatnonzero(ends)
    rows = np.arange(len(toolpath))
    # What is said on the way is said where the line begins.
    place = np.searchsorted(last, rows, side="right") - 1
    poses = np.where((says & (place >= 0))[:, None], toolpath.poses[last[np.maximum(place, 0)]], toolpath.poses)
    made = replace(
        toolpath,
        poses=poses,
        arc=np.where(straightened[:, None], 0.0, arc),
        merges_mm=np.zeros(len(toolpath)),
    ).only(np.flatnonzero(kept))
    number = np.cumsum(kept) - 1
    path = replace(made, text=MappingProxyType({int(number[row]): text for row, text in toolpath.text.items()}))
    of = number[last[np.minimum(np.searchsorted(last, rows), len(last) - 1)]]
    weight = np.where(ends | straight, toolpath.tip_mm, 0.0)
    whole = np.bincount(of, weights=weight, minlength=len(path))[of]
    share = np.divide(weight, whole, out=ends.astype(np.float64), where=whole > 0.0)
    left_out = straight & ~ends
    off_mm = _off_mm(toolpath.poses[left_out], path.before[of[left_out]], path.poses[of[left_out]])
    return Queued(path, of, share, off_mm)


def _off_mm(points: NDArray[np.float64], begins: NDArray[np.float64], ends: NDArray[np.float64]) -> float:
    """Return the greatest distance of poses from straight moves between others, shapes (k, 6) [mm]."""
    along, to = (each[:, :3] - begins[:, :3] for each in (ends, points))
    square = np.einsum("ij,ij->i", along, along)
    share = np.divide(np.einsum("ij,ij->i", along, to), square, out=np.zeros(len(square)), where=square > 0.0)
    off = to - np.clip(share, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(off, axis=1).max(initial=0.0))


def _begins(at: NDArray[np.int64], straight: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the row in which the line to each point begins, shape (k,)."""
    begins = np.append(0, at[:-1] + 1)
    # The first row after that which is a line: what lies between may be anything.
    lines = np.flatnonzero(straight)
    return np.asarray(lines[np.searchsorted(lines, begins)], dtype=np.int64)


def _short_arcs(
    toolpath: Toolpath, arc: NDArray[np.float64], within_mm: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the chords of arcs that become two lines, and those that end one, shapes (n,)."""
    number = moves_of(toolpath)
    angle = np.bincount(number, weights=np.abs(arc[:, 2]))
    first = np.searchsorted(number, np.arange(len(angle)))
    chords = np.bincount(number)
    radius_mm = np.linalg.norm(toolpath.before[first, :2] - arc[first, :2], axis=1)
    off_mm = radius_mm * (1.0 - np.cos(np.minimum(angle, 2.0 * np.pi) / 2.0))
    turns = np.bincount(number, weights=toolpath.turn_deg) > 0.0
    short = (angle > 0.0) & ~turns & (off_mm < within_mm[first])
    place = np.arange(len(toolpath)) - first[number]
    points = (place == chords[number] - 1) | (place == chords[number] // 2 - 1)
    return short[number], points & short[number]


@compiled
def _chain_ends(
    points: NDArray[np.float64], begins: NDArray[np.float64], within_mm: NDArray[np.float64], new: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return whether the line to each point is the last of a merged one, shape (k,).

    Args:
        points: X, Y, Z at the end of each line, shape (k, 3) [mm].
        within_mm: greatest distance of its points from the merged line, shape (k,).
        new: whether words precede the line, shape (k,).
    """
    count = len(points)
    ends = np.zeros(count, dtype=np.bool_)
    ends[count - 1] = True
    first = 0
    for k in range(1, count):
        begin = begins[first]
        along = points[k] - begin
        square = np.sum(along * along)
        links = not new[k] and within_mm[k] > 0.0 and square > 0.0 and k - first < MOST_POINTS
        if links:
            for inner in range(first, k):
                to = points[inner] - begin
                off = to - min(max(np.sum(along * to) / square, 0.0), 1.0) * along
                if np.sum(off * off) > within_mm[k] * within_mm[k]:
                    links = False
                    break
        if not links:
            ends[k - 1] = True
            first = k
    return ends
