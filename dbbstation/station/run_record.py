"""The current run: sample count, edges, and at the end its circle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TraceError
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.instrument.reading import DOUBTFUL, OK
from dbbstation.quality.finding import DO, Name
from dbbstation.quality.held import SHORTEST_S, HeldLength
from dbbstation.station.detector import DWELL_BEHIND_S, feed_out_due_s, live_phi_deg
from dbbstation.station.events import Sample
from dbbstation.trace.analysis import CircleFigures, figures
from dbbstation.trace.cut import cut
from dbbstation.trace.cut import lost_on_turn as shown_lost
from dbbstation.trace.recording import AFTER_LOSS, Recording, too_many_lost

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.instrument.reading import Reading
    from dbbstation.plan.plan import Circle
    from dbbstation.station.events import RunId

_STEP_S = 2e-6
"""Least time between two samples [s]: run files have microseconds, and two times must not round to the same value."""


def recording_of(run: RunId, samples: Sequence[Sample]) -> Recording:
    """Return samples of a run as a recording."""
    return Recording(
        name=run.label,
        t_s=np.array([sample.t_s for sample in samples], dtype=np.float64),
        length_mm=np.array([sample.length_mm for sample in samples], dtype=np.float64),
        usable=np.array([sample.status == "ok" for sample in samples], dtype=np.bool_),
    )


@dataclass
class RunRecord:
    """One run while it is recorded.

    Attributes:
        fed_in_s: time of the feed-in edge since the first sample; None before it.
        lost_on_turn: samples lost from feed-in to feed-out, or doubtful.
        held: detector of a standstill on the turn, with noise from earlier runs.
    """

    run: RunId
    circle: Circle
    started_s: float
    fed_in_s: float | None = None
    fed_out_s: float | None = None
    samples: int = 0
    lost: int = 0
    lost_on_turn: int = 0
    doubtful: int = 0
    held: HeldLength = field(default_factory=HeldLength)
    _last_s: float = 0.0
    _last_mm: float | None = None

    def add(self, reading: Reading) -> Sample:
        """Add a reading.

        A reading without a number repeats the last length; its status excludes it from calculations.
        """
        t_s = reading.t_s - self.started_s
        if self.samples:
            t_s = max(t_s, self._last_s + _STEP_S)
        length_mm = reading.length_mm
        if length_mm is None:
            length_mm = self.circle.bar_mm if self._last_mm is None else self._last_mm
        self._last_s, self._last_mm = t_s, length_mm
        self.samples += 1
        self.lost += reading.lost
        doubtful = int(reading.status == DOUBTFUL)
        self.doubtful += doubtful
        phi = self.phi_deg(t_s)
        if phi is not None:
            self.lost_on_turn += reading.lost + doubtful
        return Sample(t_s, length_mm, reading.status, reading.said, reading.lost, phi, reading.t_uncertainty_s)

    def phi_deg(self, t_s: float) -> float | None:
        """Return the live progress at a time since the first sample [deg]; None off the circle."""
        if self.fed_in_s is None or self.fed_out_s is not None:
            return None
        return live_phi_deg(self.circle, t_s - self.fed_in_s)

    def swept_deg(self) -> float:
        """Return the angle since the feed-in [deg]."""
        if self.fed_in_s is None or not self.samples:
            return 0.0
        return live_phi_deg(self.circle, self._last_s - self.fed_in_s) + self.circle.overshoot_deg

    def stands(self, sample: Sample) -> bool:
        """Add a sample on the turn, and return whether the gauge fails to follow the machine.

        A stuck gauge reads a constant length, although noise or the expected feed-out would change it.
        """
        if self.fed_in_s is None or sample.phi_deg is None or sample.length_mm is None or sample.status != OK:
            return False
        if sample.phi_deg < 0.0:  # the machine feeds in, which is no noise
            return False
        on_turn = sample.phi_deg <= FULL_TURN_DEG
        self.held.add(sample.t_s, sample.length_mm, noise=on_turn)
        if on_turn:
            turn_s = FULL_TURN_DEG / self.circle.turning_deg_s
            return self.held.stands(self.samples / max(sample.t_s, SHORTEST_S) * turn_s)
        overdue_s = sample.t_s - self.fed_in_s - feed_out_due_s(self.circle)
        return overdue_s > SHORTEST_S and self.held.held_s > SHORTEST_S

    @property
    def standing(self) -> str:
        """Return a sentence on a gauge that does not follow the machine."""
        stands = f"the length has stood at {self._last_mm:.4f} mm for {self.held.held_s:.1f} s"
        return f"{stands} while the machine moved: {DO[Name.HELD]}"

    def left(self, t_s: float) -> bool:
        """Return whether enough time has passed since the feed-out."""
        return self.fed_out_s is not None and t_s >= self.fed_out_s + self.circle.feeding_s / 2.0 + DWELL_BEHIND_S


def circle_figures(
    recording: Recording, circle: Circle, lost: int, lost_on_turn: int, largest_loss_percent: float
) -> tuple[CircleFigures | None, str]:
    """Return the figures of a recorded circle, or None and the reason."""
    shown, kept, unusable = shown_lost(recording, circle)
    if problem := too_many_lost(max(lost_on_turn, shown), kept, largest_loss_percent, unusable):
        return None, f"{problem}; {AFTER_LOSS}"
    try:
        return figures(cut(recording, circle, counted_lost=lost)), ""
    except TraceError as error:
        return None, str(error)


def unrecorded(reading: Reading) -> Sample:
    """Return a reading outside runs as a sample."""
    return Sample(reading.t_s, reading.length_mm, reading.status, reading.said, reading.lost)
