"""Simulate noise-free recordings of a plan by a model."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.tasks import options as o
from dbbstation.tasks.declare import File, Option, task
from dbbstation.tasks.telling import Telling

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Unpack

    from dbbstation.files.recordings.new_session import FinishedRun
    from dbbstation.results.sessions import SimulatedSession
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.tasks.telling import Hooks
    from dbbstation.trace.recording import Recording

BEGUN = datetime(2000, 1, 1, tzinfo=UTC)
"""Start of simulated sessions, a date that no measurement has."""

SIMULATING = "simulating runs"
"""Name of the counted stage."""


@task("simulate", label="runs")
def simulate(
    model: o.Model,
    plan: Annotated[File, Option("test plan.", kind="argument", metavar="PLAN")],
    *,
    source_files: o.SourceFiles = (),
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    samples: Annotated[int, Option("Samples per turn.", least=36)] = 720,
    interval_s: Annotated[float, Option("Time from the start of one run to the next [s].")] = 200.0,
    known: Mapping[str, ErrorSource] | None = None,
    **hooks: Unpack[Hooks],
) -> SimulatedSession:
    r"""Write the session that a ball bar would record on the machine of a model, without noise.

    Balls are at the positions of the plan; balls under the spindle are at the tool tip of the model. Only the machine's
    own error sources act, under a nominal control. Samples have commanded angles; lengths are written to 1 nm.

    \b
    Examples:
      dbbstation simulate --model model.yaml table2.yaml --out predicted
      dbbstation evaluate predicted --model other-model.yaml

    Args:
        known: error sources by name; None: those of package, installed packages and `source_files`.
        stop: asked before each run.

    Returns:
        Recordings in memory; `save` writes the session.

    Raises:
        ArgumentError: a value that it does not take.
        InputError: faults of files.
        StationError: an unknown test; a circle that the machine cannot travel.
        StoppedError: `stop` returned True.
    """
    from dbbstation.files.formats.plan import read_inline_plan
    from dbbstation.files.formats.session import ReadBy, SessionDetails
    from dbbstation.files.recordings.new_session import FinishedRun, write_session
    from dbbstation.model.simulation import setup_of, simulate_circle
    from dbbstation.plan.plan import chosen_of
    from dbbstation.results.sessions import SimulatedSession
    from dbbstation.tasks.models import model_of, sources_known
    from dbbstation.virtual.truth import SetUp, put_up

    telling = Telling(**hooks)
    machine_model = model_of(model, sources_known(known, source_files)).model.of_the_machine()
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
            stands = put_up(machine_model, test.circle, setup, SetUp(), len(runs) * interval_s)
            actual = replace(machine_model, sources=(*machine_model.sources, *stands))
        for direction in test.directions:
            started_s = len(runs) * interval_s
            turn = simulate_circle(actual, test.run(direction), setup, samples, started_s)
            columns = {"t_s": turn.t_s, "length_mm": turn.length_mm, "theta_deg": turn.theta_deg}
            runs.append(
                FinishedRun(test.name, direction, columns, repeat, mounting, BEGUN + timedelta(seconds=started_s))
            )
    details = SessionDetails(instrument=ReadBy("simulate", virtual=True))
    return SimulatedSession(
        runs=len(runs),
        tests=tuple(chosen),
        recordings={one.name: one for one in map(_recording, runs)},
        writing=lambda folder: write_session(folder, machine_model.machine, inline, runs, details),
    )


def _recording(run: FinishedRun) -> Recording:
    from dbbstation.trace.recording import Recording

    columns = run.columns
    return Recording(
        f"{run.test} {run.direction} {run.repeat}", columns["t_s"], columns["length_mm"], columns["theta_deg"]
    )
