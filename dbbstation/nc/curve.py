"""The command curve that makes the tool follow a toolpath."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dbbstation.model.compensation import begun, compensated_on
from dbbstation.nc.toolpath import lengths
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.model.compensation import Passed
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.nc.toolpath import Toolpath

    Behind: TypeAlias = tuple[Floats, Passed]
    """Pose commanded last, shape (6,) [mm, deg], and the memory of the model's sources."""

LEVER_MM = 100.0
"""The tilt between points may err until a point this far from the tool tip moves by the chord error."""

PLACES_AT_ONCE = 2048
"""Number of places that are inverted together: enough for fast arrays. A program of 10,000 blocks takes a twentieth longer
with 4,096, which are shared between threads."""

HOLDING = 3
"""Iterations that adjust the wanted tilt until the commanded tilt is as programmed. Each iteration reduces the difference to a thousandth."""


class CommandCurve:
    """The commands along a toolpath.

    Args:
        model: calibrated; only sources of the machine are inverted.
        started_s: start of the program on the time scale of the model's sessions; None if unknown.
        hold_tilt: correct the tool tip alone and command A, B and C as programmed.
        before: from the preceding part; None: no earlier motion.
    """

    def __init__(
        self,
        toolpath: Toolpath,
        model: MachineModel,
        started_s: float | None,
        *,
        hold_tilt: bool = False,
        before: Behind | None = None,
    ) -> None:
        self.toolpath = toolpath
        self._model = model
        self._started_s = started_s
        self._hold_tilt = hold_tilt
        self.leads_on = (toolpath.tip_mm > 0.0) | (toolpath.turn_deg > 0.0)
        self.has_history = any(fitted.source.has_history for fitted in model.of_the_machine().sources)
        self._waits = ~self.leads_on & (toolpath.duration_s > 0.0) & self.has_history
        self.tilt_left_mm = 0.0
        """Largest omitted correction of the tilt so far, as motion at `LEVER_MM` [mm]."""
        self._before = before
        self.behind = before
        """State after the last computed place."""

    def at(self, places: Floats) -> Floats:
        """Return poses to command at places in program order, shape (k, 6) [mm, deg].

        Raises:
            KinematicsError: a pose that the machine cannot take.
            ModelError: a source needs data that a program lacks.
        """
        path = self.toolpath
        row, share = row_and_share(places)
        # In time order: where the machine stands first.
        moves = self.leads_on[row] & (places > 0)
        taken = moves | (self._waits[row] & (share == 1.0))
        if not moves.any():
            return path.poses[row]
        poses = path.between(row[taken], share[taken])
        time_s = None
        if self._started_s is not None:
            begin_s = path.end_s - path.duration_s
            time_s = self._started_s + begin_s[row[taken]] + share[taken] * path.duration_s[row[taken]]
        if self._before is None:
            poses = np.vstack([path.before[0], poses])
            if time_s is not None and self._started_s is not None:
                time_s = np.concatenate([[self._started_s], time_s])
        inverse = self._inverted(Motion(poses=poses, is_path=True, time_s=time_s))
        behind = np.cumsum(taken)
        # Until the next place that leads somewhere the machine stands where it comes to rest.
        rests = np.append(~moves[1:], False)
        resting = np.flatnonzero(~rests)
        at_rest = behind[resting[np.searchsorted(resting, np.arange(len(row)))]]
        return inverse[at_rest]

    def _inverted(self, wanted: Motion) -> Floats:
        command, passed = (None, None) if self._before is None else self._before
        parts = [] if command is None else [command[None]]
        for start in range(0, len(wanted), PLACES_AT_ONCE):
            stretch = wanted.stretch(slice(start, start + PLACES_AT_ONCE))
            part, passed = self._stretch(passed or begun(self._model, stretch), stretch)
            parts.append(part)
        commands = np.concatenate(parts)
        if passed is not None:
            self.behind = commands[-1], passed
        return commands

    def _stretch(self, passed: Passed, wanted: Motion) -> tuple[Floats, Passed]:
        command, behind = compensated_on(passed, wanted)
        if not self._hold_tilt:
            return command, behind
        programmed = wanted.poses[:, 3:]
        left = np.hstack([np.zeros((len(command), 3)), command[:, 3:] - programmed])
        self.tilt_left_mm = max(self.tilt_left_mm, float(felt_mm(left).max(initial=0.0)))
        held = wanted.poses.copy()
        for _ in range(HOLDING):
            held[:, 3:] += programmed - command[:, 3:]
            command, behind = compensated_on(passed, replace(wanted, poses=held))
        return np.hstack([command[:, :3], programmed]), behind


def row_and_share(places: Floats) -> tuple[Integers, Floats]:
    """Return rows and completed shares of places, shapes (k,); a row includes its end, but not its begin."""
    row = np.maximum(np.ceil(places).astype(np.int64) - 1, 0)
    return row, places - row


def felt_mm(off: Floats) -> Floats:
    """Return the motion that pose differences, shape (k, 6), cause at the tip or the lever, shape (k,) [mm]: the larger one."""
    return np.maximum(lengths(off[:, :3]), math.radians(LEVER_MM) * lengths(off[:, 3:]))


def rounding_mm(decimals: Sequence[int]) -> float:
    """Return the largest motion at the tip or the lever if all six axes are rounded to these decimals [mm]."""
    return float(felt_mm(0.5 / 10.0 ** np.array([decimals]))[0])


def in_mm(poses: Floats) -> Floats:
    """Return poses, shape (k, 6), with angles as the motion of a point at the lever [mm]."""
    return poses * np.repeat([1.0, np.radians(LEVER_MM)], 3)
