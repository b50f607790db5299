"""Traces of a test with a limited number of points: measured, centred, and the difference of the directions."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import largest_size
from dbbstation.errors import StationError, TraceError
from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.station.events import RunId
from dbbstation.trace.analysis import best_circle
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.plan.plan import Circle, Direction
    from dbbstation.station.events import Sample
    from dbbstation.trace.recording import RawCircle

_FIRST_ROOM = 4096

_TURN_DEG = 360.0

STEP_DEG = 0.05
"""Step of the travel in which the least and greatest sample are kept [deg]: a tenth of a dot of the largest screen. A
turn then has at most three points per step at any sampling rate."""


class View(StrEnum):
    """Views of a test; the value is the shown text."""

    MEASURED = "as measured"
    CENTRED = "centred"
    DIFFERENCE = "ccw − cw centred"


class LiveTrace:
    """Live angles and deviations of one run."""

    def __init__(self, run: RunId, circle: Circle) -> None:
        self.run = run
        self.circle = circle
        self.largest_um = 0.0
        self.centred: Derived | None = None
        self._count = 0
        self._step, self._step_from = -1, 0
        self._data = np.empty((2, _FIRST_ROOM))

    @classmethod
    def of(cls, run: RunId, turn: RawCircle) -> LiveTrace:
        """Return the trace of a recorded turn with all samples, which can be centred."""
        trace = cls(run, turn.circle)
        deviation_um = 1e3 * (turn.length_mm - turn.circle.bar_mm)
        trace._append(turn.circle.theta_deg(turn.phi_deg), deviation_um)
        trace.largest_um = largest_size(deviation_um)
        trace.centre()
        return trace

    def __len__(self) -> int:
        return self._count

    @property
    def theta_deg(self) -> Floats:
        """Return angles from +X towards +Y, shape (n,) [deg]."""
        return self._data[0, : self._count]

    @property
    def deviation_um(self) -> Floats:
        """Return bar length minus nominal length, shape (n,) [µm]; NaN breaks the line."""
        return self._data[1, : self._count]

    def centre(self) -> None:
        """Subtract the least-squares circle, so that the scale shows the form."""
        known = np.isfinite(self.deviation_um)
        height_mm = self.circle.bar_mm * np.sin(np.radians(self.circle.elevation_deg))
        radius_mm = np.sqrt((self.circle.bar_mm + self.deviation_um[known] / 1e3) ** 2 - height_mm**2)
        left_um = np.full(len(self), np.nan)
        try:
            left_um[known] = 1e3 * best_circle(self.theta_deg[known], radius_mm)[2]
        except TraceError:
            return
        self.centred = Derived(View.CENTRED, self, left_um, largest_size(left_um[known]))

    def add(self, samples: Sequence[Sample]) -> None:
        """Add samples in time order."""
        # Strictly inside what is travelled: at its very ends stands the bar while it feeds in and out.
        first, last = -self.circle.overshoot_deg, _TURN_DEG + self.circle.overshoot_deg
        on_turn = [
            sample
            for sample in samples
            if sample.phi_deg is not None and first < sample.phi_deg < last and 0.0 <= sample.phi_deg < _TURN_DEG
        ]
        if not on_turn:
            return
        phi = np.array([sample.phi_deg for sample in on_turn], dtype=np.float64)
        length = np.array([sample.length_mm for sample in on_turn], dtype=np.float64)
        usable = np.array([sample.status == "ok" for sample in on_turn])
        deviation = 1e3 * (length - self.circle.bar_mm)
        # Beyond half the feed-in it is off the circle: a bar that was lifted, or the feed-out.
        usable &= np.abs(deviation) < 1e3 * self.circle.feed_in_mm / 2.0
        behind_gap = np.flatnonzero([sample.lost > 0 for sample in on_turn])
        steps = np.insert(phi // STEP_DEG, behind_gap, phi[behind_gap] // STEP_DEG).astype(np.int64)
        theta = np.insert(self.circle.theta_deg(phi), behind_gap, np.nan)
        shown = np.insert(np.where(usable, deviation, np.nan), behind_gap, np.nan)
        for step in np.unique(steps).tolist():
            self._take(step, theta[steps == step], shown[steps == step])
        if usable.any():
            self.largest_um = max(self.largest_um, largest_size(deviation[usable]))

    def _take(self, step: int, theta_deg: Floats, deviation_um: Floats) -> None:
        if step == self._step:
            kept = self._data[:, self._step_from : self._count]
            theta_deg = np.concatenate([kept[0], theta_deg])
            deviation_um = np.concatenate([kept[1], deviation_um])
            self._count = self._step_from
        self._step, self._step_from = step, self._count
        breaks = np.flatnonzero(np.isnan(deviation_um))
        telling = {int(breaks[0])} if len(breaks) else set()
        if len(breaks) < len(deviation_um):
            telling |= {int(np.nanargmin(deviation_um)), int(np.nanargmax(deviation_um))}
        chosen = sorted(telling)
        self._append(theta_deg[chosen], deviation_um[chosen])

    def _append(self, theta_deg: Floats, deviation_um: Floats) -> None:
        end = self._count + len(theta_deg)
        if end > self._data.shape[1]:
            wider = np.empty((2, max(2 * self._data.shape[1], end)))
            wider[:, : self._count] = self._data[:, : self._count]
            self._data = wider
        self._data[:, self._count : end] = theta_deg, deviation_um
        self._count = end


@dataclass(frozen=True, eq=False)
class Derived:
    """A complete trace minus its circle or minus the other direction.

    Attributes:
        deviation_um: shape (n,); NaN breaks the line.
    """

    view: View
    measured: LiveTrace
    deviation_um: Floats
    largest_um: float

    def __len__(self) -> int:
        return len(self.deviation_um)

    @property
    def run(self) -> RunId:
        """Return the run."""
        return self.measured.run

    @property
    def theta_deg(self) -> Floats:
        """Return angles from +X towards +Y, shape (n,) [deg]."""
        return self.measured.theta_deg[: len(self)]


def difference(ccw: Derived, cw: Derived) -> Derived | None:
    """Return counter-clockwise minus clockwise at equal angles, or None without common angles."""
    placed = np.isfinite(cw.theta_deg)
    if not placed.any():
        return None
    # A reading that is no length makes what lies next to it none either.
    less_um = np.interp(ccw.theta_deg, cw.theta_deg[placed], cw.deviation_um[placed], period=_TURN_DEG)
    left_um = ccw.deviation_um - less_um
    known = np.isfinite(left_um)
    return Derived(View.DIFFERENCE, ccw.measured, left_um, largest_size(left_um[known])) if known.any() else None


def last_traces(folder: Path, test: str) -> dict[Direction, LiveTrace]:
    """Return a test's last accepted circles in the former session, by direction; may be empty.

    Raises:
        InputError: the present session cannot be read.
    """
    formers = former_sessions(read_session(folder), folder.absolute().parent, {test})
    if not formers:
        return {}
    _, session = formers[0]
    traces = {}
    for run in session.in_state(RunState.ACCEPTED):
        if run.test != test:
            continue
        try:
            circle = cut(session.load(run).recording, session.circle(run))
        except StationError:
            continue
        traces[run.direction] = LiveTrace.of(RunId(test, run.direction, run.repeat, run.mounting or 1), circle)
    return traces
