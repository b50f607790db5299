"""The run that goes on: its samples so far, whether its edges were seen, what its circle says in the end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import TraceError
from dbbstation.station.detector import DWELL_BEHIND_S, live_phi_deg
from dbbstation.station.events import Sample
from dbbstation.trace.analysis import CircleFigures, figures
from dbbstation.trace.cut import cut, lost_on_turn
from dbbstation.trace.loss import AFTER_LOSS, too_many_lost
from dbbstation.trace.recording import Recording

if TYPE_CHECKING:
    from dbbstation.instrument.reading import Reading
    from dbbstation.plan.circle import Circle
    from dbbstation.station.events import RunId

_STEP_S = 2e-6
"""Run files have microseconds; two samples must not round to the same one."""


@dataclass
class RunRecord:
    """Samples of one run.

    Attributes:
        run: which run.
        circle: as commanded.
        started_s: time of the first sample on the driver's clock [s].
        fed_in_s: of the feed-in edge, since the first sample [s]; None before.
        fed_out_s: of the feed-out edge, likewise.
    """

    run: RunId
    circle: Circle
    started_s: float
    fed_in_s: float | None = None
    fed_out_s: float | None = None
    _lost: list[int] = field(default_factory=list)
    _t_s: list[float] = field(default_factory=list)
    _length_mm: list[float] = field(default_factory=list)
    _usable: list[bool] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._t_s)

    def add(self, reading: Reading) -> Sample:
        """Take a reading into the run.

        A reading without a number repeats the last one, so that the file keeps what the instrument said and when;
        its status keeps it out of every calculation.
        """
        t_s = reading.t_s - self.started_s
        if self._t_s:
            t_s = max(t_s, self._t_s[-1] + _STEP_S)
        length_mm = reading.length_mm
        if length_mm is None:
            length_mm = self._length_mm[-1] if self._length_mm else self.circle.bar_mm
        self._t_s.append(t_s)
        self._length_mm.append(length_mm)
        self._usable.append(reading.status == "ok")
        self._lost.append(reading.lost)
        phi = None
        if self.fed_in_s is not None and self.fed_out_s is None:
            phi = live_phi_deg(self.circle, t_s - self.fed_in_s)
        return Sample(t_s, length_mm, reading.status, reading.said, reading.lost, phi)

    @property
    def lost(self) -> int:
        """Samples that the line counted as lost, wherever in the run."""
        return sum(self._lost)

    def swept_deg(self) -> float:
        """Travelled since the feed-in, as far as it can be told live [deg]."""
        if self.fed_in_s is None or not self._t_s:
            return 0.0
        return live_phi_deg(self.circle, self._t_s[-1] - self.fed_in_s) + self.circle.overshoot_deg

    def left(self, t_s: float) -> bool:
        """Whether at a time since the first sample enough lies behind the feed-out."""
        rest_s = self.circle.feed_in_mm / 2.0 / (self.circle.feed_mm_min / 60.0)
        return self.fed_out_s is not None and t_s >= self.fed_out_s + rest_s + DWELL_BEHIND_S

    def circle_figures(self, largest_loss_percent: float) -> tuple[CircleFigures | None, str]:
        """Return the figures of the circle, or None and why there is none.

        Args:
            largest_loss_percent: share of the samples that may be lost [%].
        """
        recording = Recording(
            name=self.run.label,
            t_s=np.array(self._t_s),
            length_mm=np.array(self._length_mm),
            usable=np.array(self._usable, dtype=np.bool_),
        )
        return circle_figures(recording, self.circle, self._lost_between_edges(), largest_loss_percent)

    def _lost_between_edges(self) -> int:
        """Samples that the line counted as lost from feed-in to feed-out."""
        begin = -np.inf if self.fed_in_s is None else self.fed_in_s
        end = np.inf if self.fed_out_s is None else self.fed_out_s
        return sum(lost for t, lost in zip(self._t_s, self._lost, strict=True) if begin < t <= end)


def circle_figures(
    recording: Recording, circle: Circle, lost: int, largest_loss_percent: float
) -> tuple[CircleFigures | None, str]:
    """Return the figures of a recorded circle, or None and why there is none.

    Args:
        recording: of the whole run.
        circle: as commanded.
        lost: samples that the line counted as lost from feed-in to feed-out; 0 where nobody counted.
        largest_loss_percent: share of the samples that may be lost [%].
    """
    shown, kept = lost_on_turn(recording, circle)
    if problem := too_many_lost(max(lost, shown), kept, largest_loss_percent):
        return None, f"{problem}; {AFTER_LOSS}"
    try:
        return figures(cut(recording, circle)), ""
    except TraceError as error:
        return None, str(error)


def unrecorded(reading: Reading) -> Sample:
    """Return a reading that belongs to no run as a sample."""
    return Sample(reading.t_s, reading.length_mm, reading.status, reading.said, reading.lost)
