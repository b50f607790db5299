"""Traces of a test with a limited number of points: measured, centred, and the difference of the directions."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import inf, isnan, nan
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.arrays import largest_size
from dbbstation.errors import StationError, TraceError
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
        self._step = -1
        self._kept: list[tuple[float, float]] = []
        self._range_um = inf, -inf
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
        for sample in samples:
            phi = sample.phi_deg
            if phi is None or not (first < phi < last and 0.0 <= phi < _TURN_DEG):
                continue
            if sample.lost > 0:
                self._take(phi, nan, nan)
            length_mm = nan if sample.length_mm is None else sample.length_mm
            deviation_um = 1e3 * (length_mm - self.circle.bar_mm)
            # Beyond half the feed-in it is off the circle: a bar that was lifted, or the feed-out.
            usable = sample.status == "ok" and abs(deviation_um) < 1e3 * self.circle.feed_in_mm / 2.0
            if usable:
                self.largest_um = max(self.largest_um, abs(deviation_um))
            self._take(phi, self.circle.start_deg + self.circle.direction.sign * phi, deviation_um if usable else nan)

    def _take(self, phi_deg: float, theta_deg: float, deviation_um: float) -> None:
        """Keep a point if it is its step's first break, or its least or greatest deviation."""
        step = int(phi_deg // STEP_DEG)
        if step != self._step:
            self._step, self._kept, self._range_um = step, [], (inf, -inf)
        elif self._range_um[0] <= deviation_um <= self._range_um[1]:
            return
        points = [*self._kept, (theta_deg, deviation_um)]
        telling = [point for point in points if isnan(point[1])][:1]
        if known := [point for point in points if not isnan(point[1])]:
            least, greatest = min(known, key=itemgetter(1)), max(known, key=itemgetter(1))
            telling += [least, greatest]
            self._range_um = least[1], greatest[1]
        self._count -= len(self._kept)
        self._kept = [point for point in points if any(point is each for each in telling)]
        self._append(*np.transpose(self._kept))

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
    for run in session.accepted:
        if run.test != test:
            continue
        try:
            circle = cut(session.load(run).recording, session.circle(run))
        except StationError:
            continue
        traces[run.direction] = LiveTrace.of(RunId(test, run.direction, run.repeat, run.mounting or 1), circle)
    return traces
