"""Prepare runs of a session for judging: recordings and expected circles."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MachineError, TraceError
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.files.formats.session import RunEntry, RunState
from dbbstation.model.expected import SECTORS, expected_circle
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Observation
from dbbstation.quality.judge import Judgement, judge
from dbbstation.quality.knowledge import Planned, Run
from dbbstation.sources.registry import known_sources
from dbbstation.trace.cut import cut
from dbbstation.trace.recording import RawCircle

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.trace.expected import Expected
    from dbbstation.trace.recording import Recording

JUDGED = (RunState.ACCEPTED, RunState.COMPLETE)
"""States of judged runs: rejected runs are unused, and running ones incomplete."""


def judge_session(
    session: SessionFolder,
    wanted: Sequence[tuple[RunEntry, Recording]],
    model: IdentifiedModel | None = None,
) -> tuple[Judgement, ...]:
    """Judge runs of a session.

    Args:
        model: None: only usual sizes of machine errors are known.
    """
    planned = () if model is None else circles_of_plan(session, model)
    return judge([run_of(session, run, recording, model, planned) for run, recording in wanted])


def run_of(
    session: SessionFolder,
    run: RunEntry,
    recording: Recording,
    model: IdentifiedModel | None,
    planned: tuple[Planned, ...],
) -> Run:
    """Return one run prepared for judging."""
    circle, recording = session.circle(run), replace(recording, name=run.label)
    # A compensated program is there to put the circle where it is planned. That is where it is expected.
    of_it = None if run.program is not None else model
    return Run(
        test=run.test,
        repeat=run.repeat,
        mounting=session.setup(run).mounting,
        circle=circle,
        recording=recording,
        expected=_expected(session, run, recording, of_it),
        usual=None if of_it is None else _expected(session, run, recording, None),
        largest_loss_percent=session.plan.largest_loss_percent,
        # Compensated programs are there to make all circles alike: what one looks like says nothing.
        planned=() if run.program is not None else planned,
        started_s=session.started_s(run),
        bar_stated=session.bar is not None,
    )


def circles_of_plan(session: SessionFolder, model: IdentifiedModel | None) -> tuple[Planned, ...]:
    """Return all circles of a plan as expected by a model, else by the nominal machine."""
    found = []
    for (name, direction), circle in session.plan.runs().items():
        run = RunEntry(test=name, direction=direction, repeat=0, state=RunState.RECORDING, path=session.folder)
        phi_deg = (np.arange(SECTORS) + 0.5) * FULL_TURN_DEG / SECTORS
        ideal = RawCircle("", circle, phi_deg / circle.turning_deg_s, phi_deg, np.full(SECTORS, circle.bar_mm))
        with suppress(MachineError):
            found.append(Planned(name, circle, _expected_of(session, run, ideal, model)))
    return tuple(found)


def _expected(
    session: SessionFolder, run: RunEntry, recording: Recording, model: IdentifiedModel | None
) -> Expected | None:
    """Return the expected place of the circle; None without a circle, or if the machine cannot reach it."""
    try:
        return _expected_of(session, run, cut(recording, session.circle(run)), model)
    except (TraceError, MachineError):
        return None


def _expected_of(session: SessionFolder, run: RunEntry, raw: RawCircle, model: IdentifiedModel | None) -> Expected:
    setup = session.setup(run, raw.temperature_degc)
    if session.bar is None:
        # A bar that nobody calibrated is as long in all runs of the session: one that reads another length is found.
        setup = replace(setup, bar_uncertainty_mm=0.0)
    observation = Observation(run.test, run.repeat, raw, setup, started_s=session.started_s(run) or 0.0)
    return expected_circle(
        observation, MachineModel(session.machine) if model is None else model, known_sources().values()
    )
