"""Readings as a perfect run brings them, without any machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.instrument.reading import Reading
from dbbstation.station.events import SamplesRecorded
from dbbstation.station.run_record import recording_of
from dbbstation.virtual.machine import circle_path

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from dbbstation.plan.plan import Circle
    from dbbstation.station.events import Event, RunId, Sample
    from dbbstation.trace.recording import Recording

RATE_HZ = 20.0


def run_readings(circle: Circle, begin_s: float = 0.0, rate_hz: float = RATE_HZ) -> list[Reading]:
    path = circle_path(circle)
    t_s = np.arange(0.0, path.duration_s, 1.0 / rate_hz)
    place = np.column_stack([np.interp(t_s, path.t_s, path.poses[:, axis]) for axis in range(3)])
    length = np.linalg.norm(place - np.array(circle.ball_mm), axis=1)
    return [Reading(begin_s + float(t), float(value)) for t, value in zip(t_s, length, strict=True)]


def told_and_untold(told: Sequence[Event]) -> Callable[[RunId, Sequence[Sample]], Recording]:
    def recorded(run: RunId, behind: Sequence[Sample]) -> Recording:
        batches = [event.samples for event in told if isinstance(event, SamplesRecorded) and event.run == run]
        return recording_of(run, [*(sample for batch in batches for sample in batch), *behind])

    return recorded


def still(length_mm: float | None, seconds: float, begin_s: float = 0.0) -> list[Reading]:
    """Readings of a bar that does not move; None: it is not there."""
    count = int(seconds * RATE_HZ)
    status = "ok" if length_mm is not None else "fault"
    return [Reading(begin_s + k / RATE_HZ, length_mm, status) for k in range(count)]  # type: ignore[arg-type]


def kinds(events: Iterable[Event]) -> list[str]:
    quiet = {"StateChanged", "ReadingsSeen", "SamplesRecorded", "RunProgress"}
    return [name for event in events if (name := type(event).__name__) not in quiet]
