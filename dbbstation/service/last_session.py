"""Circles of the last session of the same machine and plan, which are drawn beneath the present circles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import StationError
from dbbstation.files.formats.session import RunState
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.service.live_trace import LiveTrace
from dbbstation.station.events import RunId
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.plan.circle import Direction


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
