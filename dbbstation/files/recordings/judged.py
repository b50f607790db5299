"""The runs of a session as they are judged: recordings, and where their circles should lie."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.errors import MachineError, TraceError
from dbbstation.files.recordings.entries import RunState
from dbbstation.model.expected import expected_circle
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Observation
from dbbstation.quality.judge import Judgement, judge
from dbbstation.quality.knowledge import Run
from dbbstation.sources.registry import known_sources
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.files.recordings.entries import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.quality.knowledge import Expected
    from dbbstation.trace.recording import Recording

JUDGED = (RunState.ACCEPTED, RunState.COMPLETE)
"""Runs that are judged: what was rejected is not used, what is being recorded is not whole."""


def judge_session(
    session: SessionFolder,
    wanted: Sequence[tuple[RunEntry, Recording]],
    model: IdentifiedModel | None = None,
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[Judgement, ...]:
    """Judge runs of a session.

    Args:
        session: the session.
        wanted: its runs with their recordings, in the order in which they were recorded.
        model: of the machine; None: only the usual sizes of what machines have are known.
        progress: told how many of how many runs are analysed.
    """
    runs = runs_of(session, wanted, model)
    return judge(runs, progress)


def runs_of(
    session: SessionFolder, wanted: Sequence[tuple[RunEntry, Recording]], model: IdentifiedModel | None = None
) -> tuple[Run, ...]:
    """Return runs of a session as they are judged; arguments as of `judge_session`."""
    return tuple(_run(session, run, recording, model) for run, recording in wanted)


def _run(session: SessionFolder, run: RunEntry, recording: Recording, model: IdentifiedModel | None) -> Run:
    circle, recording = session.circle(run), replace(recording, name=run.label)
    return Run(
        test=run.test,
        repeat=run.repeat,
        mounting=session.setup(run).mounting,
        circle=circle,
        recording=recording,
        expected=_expected(session, run, recording, model),
        largest_loss_percent=session.plan.largest_loss_percent,
    )


def _expected(
    session: SessionFolder, run: RunEntry, recording: Recording, model: IdentifiedModel | None
) -> Expected | None:
    """Where the circle should lie; None for a recording that shows none, or a circle that the machine cannot take.

    A compensated program is there to put the circle where it is planned: that is where it is expected.
    """
    nominal = MachineModel(session.machine)
    known_by = nominal if model is None or run.program is not None else model
    try:
        raw = cut(recording, session.circle(run))
        setup = session.setup(run, raw.temperature_degc)
        if session.bar is None:
            # A bar that nobody calibrated is as long in all runs of the session: one that reads another length is found.
            setup = replace(setup, bar_uncertainty_mm=0.0)
        observation = Observation(run.test, run.repeat, raw, setup)
        return expected_circle(observation, known_by, known_sources().values())
    except (TraceError, MachineError):
        return None
