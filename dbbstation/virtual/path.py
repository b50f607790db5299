"""Commanded poses of the virtual control over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MachineError
from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.toolpath import Toolpath
    from dbbstation.plan.plan import Circle


@dataclass(frozen=True, eq=False)
class CommandedPath:
    """Poses with times; motion is even in between."""

    t_s: Floats
    poses: Floats

    @property
    def duration_s(self) -> float:
        """Return the duration [s]."""
        return float(self.t_s[-1])


def circle_path(circle: Circle) -> CommandedPath:
    """Return a run's path with dwells and corners."""
    return path_of(circle_toolpath(circle, "circle", approach=None))


def path_of(toolpath: Toolpath) -> CommandedPath:
    """Return the path of a program while the bar is on: between its first and last pause, if it has any.

    Raises:
        MachineError: it does not move.
    """
    pauses = np.flatnonzero(toolpath.kind == RowKind.PAUSE)
    first = int(pauses[0]) if len(pauses) else 0
    last = int(pauses[-1]) if len(pauses) > 1 else len(toolpath) - 1
    t_s, poses = toolpath.end_s[first : last + 1], toolpath.poses[first : last + 1]
    known = ~np.isnan(poses).any(axis=1)
    t_s, poses = t_s[known], poses[known]
    # Of rows that take no time the last holds; a path of nothing but such rows is none.
    kept = np.append(np.diff(t_s) > 0.0, True) if len(t_s) else np.zeros(0, dtype=bool)
    t_s, poses = t_s[kept], poses[kept]
    if len(t_s) < 2:  # noqa: PLR2004 - a move has two ends
        raise MachineError(
            "the program does not move the machine between its pauses",
            where=toolpath.name,
            remedy="give the program of a circle",
        )
    return CommandedPath(t_s - t_s[0], poses)
