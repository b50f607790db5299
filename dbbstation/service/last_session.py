"""Circles of the last session of the same machine and plan, to be drawn beneath those that are measured now."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import StationError
from dbbstation.files.recordings.entries import RunState
from dbbstation.files.recordings.session import read_session
from dbbstation.service.former_sessions import former_sessions
from dbbstation.service.live_trace import LiveTrace
from dbbstation.station.events import RunId
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.plan.circle import Direction


def last_traces(folder: Path, test: str) -> dict[Direction, LiveTrace]:
    """Return the last accepted circles of a test in the last session before, by direction; empty where there is none.

    A circle that cannot be read or cut is left out: it is only looked at beside the new one.

    Args:
        folder: of the session that is measured now; the former ones lie beside it.

    Raises:
        InputError: the session that is measured now cannot be read.
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
