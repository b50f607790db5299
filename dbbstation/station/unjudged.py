"""Complete runs without verdict, after a crash or a quit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.recordings.entries import RunState
from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.station.events import RunCompleted, RunId, Sample
from dbbstation.station.run_record import circle_figures
from dbbstation.station.sequencer import Waiting
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.recordings.entries import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.quality.finding import Finding
    from dbbstation.trace.circle import RawCircle
    from dbbstation.trace.recording import Recording


def unjudged(
    session: SessionFolder, judge: Callable[[RunId, Recording], tuple[Finding, ...]] = lambda _run, _recording: ()
) -> list[Waiting]:
    """Return unjudged runs in recording order."""
    return [_waiting(session, entry, judge) for entry in session.runs if entry.state is RunState.COMPLETE]


def _waiting(
    session: SessionFolder, entry: RunEntry, judge: Callable[[RunId, Recording], tuple[Finding, ...]]
) -> Waiting:
    run = RunId(entry.test, entry.direction, entry.repeat, entry.mounting or 0)
    try:
        recording = session.load(entry).recording
    except InputError as error:
        return Waiting(RunCompleted(run, 0, 0, None, str(error)), ())
    circle = session.circle(entry)
    lost = entry.counts.lost if entry.counts is not None else 0
    found, problem = circle_figures(recording, circle, lost, lost, session.plan.largest_loss_percent)
    samples = () if found is None else _on_turn(cut(recording, circle))
    findings = () if found is None else judge(run, recording)
    doubtful = 0 if entry.counts is None else entry.counts.rejected.get(DOUBTFUL, 0)
    return Waiting(RunCompleted(run, len(recording), lost, found, problem, findings, doubtful), samples)


def _on_turn(raw: RawCircle) -> tuple[Sample, ...]:
    step = max(len(raw) // MOST_SHOWN, 1)
    rows = zip(raw.t_s[::step].tolist(), raw.length_mm[::step].tolist(), raw.phi_deg[::step].tolist(), strict=True)
    return tuple(Sample(t_s, length_mm, phi_deg=phi_deg) for t_s, length_mm, phi_deg in rows)


MOST_SHOWN = 3600
"""Samples of a turn that are drawn again, about: ten for each degree."""
