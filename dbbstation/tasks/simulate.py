"""Simulate noise-free recordings of a plan by a model."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.errors import OutputError
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.recordings.entries import ReadBy
from dbbstation.files.recordings.new_session import FinishedRun, write_session
from dbbstation.files.recordings.session_details import SessionDetails
from dbbstation.model.simulation import setup_of, simulate_circle
from dbbstation.results.sessions import SimulatedSession
from dbbstation.tasks.chosen import chosen_of
from dbbstation.tasks.models import model_of
from dbbstation.tasks.telling import Telling, never, silent
from dbbstation.virtual.under_spindle import SetUp, put_up

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from os import PathLike

    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.models import Model
    from dbbstation.tasks.telling import Progress

BEGUN = datetime(2000, 1, 1, tzinfo=UTC)
"""A date that nobody takes for a measurement's."""

SIMULATING = "simulating runs"
"""The stage that is counted."""


def simulate(
    model: Model,
    plan: str | PathLike[str],
    out: str | PathLike[str],
    *,
    tests: Sequence[str] = (),
    exclude: Sequence[str] = (),
    samples: int = 720,
    interval_s: float = 200.0,
    known: Mapping[str, ErrorSource] | None = None,
    progress: Progress = silent,
    stop: Callable[[], bool] = never,
) -> SimulatedSession:
    """Write the session that a ball bar would record on a model's machine, without noise.

    Balls are at the plan's positions, balls under the spindle at the model's tool tip. Only the machine's own sources
    act, under a nominal control. Lengths are written to 1 nm.

    Args:
        model: a model, its file, or the result of `calibrate` or `diagnose`.
        out: new session folder.
        tests: names; empty for all.
        interval_s: between starts of runs.

    Raises:
        InputError: faults of files.
        OutputError: the folder exists.
        StationError: an unknown test; a circle that the machine cannot travel.
        StoppedError: `stop` returned True; nothing was written.
    """
    folder, telling = Path(out), Telling(progress, stop)
    if folder.exists():
        raise OutputError("the session folder exists already", where=str(folder), remedy="choose another name")
    machine_model = model_of(model, known).model.of_the_machine()
    machine_model = replace(machine_model, machine=replace(machine_model.machine, control=None))
    inline = read_inline_plan(Path(plan))
    planned = inline.to_domain()
    planned.check(machine_model.machine)
    chosen = chosen_of(planned.name, planned.tests, tests, exclude)
    order = [(planned.tests[name], 1) for name in chosen]
    order += [(planned.tests[name], 2) for name in planned.repeat_at_end if name in chosen]
    runs: list[FinishedRun] = []
    for mounting, (test, repeat) in enumerate(order, start=1):
        telling.stage(SIMULATING, mounting - 1, len(order))
        setup, actual = setup_of(test), machine_model
        if not test.ball.place_known:
            stands = put_up(machine_model, test.circle, setup, SetUp.faultless(), len(runs) * interval_s)
            actual = replace(machine_model, sources=(*machine_model.sources, *stands))
        for direction in test.directions:
            started_s = len(runs) * interval_s
            turn = simulate_circle(actual, test.run(direction), setup, samples, started_s)
            columns = {"t_s": turn.t_s, "length_mm": turn.length_mm, "theta_deg": turn.theta_deg}
            runs.append(
                FinishedRun(test.name, direction, columns, repeat, mounting, BEGUN + timedelta(seconds=started_s))
            )
    details = SessionDetails(instrument=ReadBy("simulate", virtual=True))
    write_session(folder, machine_model.machine, inline, runs, details)
    return SimulatedSession(str(out), len(runs), tuple(chosen))
