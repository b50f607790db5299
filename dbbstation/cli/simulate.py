"""`dbbstation simulate`: noise-free recordings of a plan, as a model predicts them."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.source_files import source_file_option
from dbbstation.tasks.chosen import chosen_of


@click.command()
@click.option("--model", required=True, type=click.Path(path_type=Path), help="Model file of `calibrate`.")
@source_file_option
@click.option("--plan", required=True, type=click.Path(path_type=Path), help="Test plan.")
@click.option("--out", required=True, type=click.Path(path_type=Path, file_okay=False), help="Session folder to make.")
@chosen_tests_options
@click.option("--samples", default=720, show_default=True, type=click.IntRange(36), help="Samples per turn.")
@click.option(
    "--interval-s",
    type=Finite(),
    default=200.0,
    show_default=True,
    help="Time from the start of one run to the next [s].",
)
@click.option("--json", "as_json", is_flag=True, help="Print what was written as JSON.")
def simulate(
    *,
    model: Path,
    source_files: tuple[Path, ...],
    plan: Path,
    out: Path,
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    samples: int,
    interval_s: float,
    as_json: bool,
) -> None:
    r"""Write the session that a ball bar would record on the machine of a model, without noise.

    Balls are at the positions of the plan; balls under the spindle are at the tool tip of the model. Only the machine's
    own error sources act. Samples have commanded angles; lengths are written to 1 nm.

    \b
    Examples:
      dbbstation simulate --model model.yaml --plan table2.yaml --out predicted
      dbbstation evaluate predicted --model other-model.yaml
    """
    from dataclasses import replace
    from datetime import UTC, datetime, timedelta

    from dbbstation.cli.output import print_json, say
    from dbbstation.errors import OutputError
    from dbbstation.files.formats.model import read_model
    from dbbstation.files.formats.plan import read_inline_plan
    from dbbstation.files.own_sources import every_source
    from dbbstation.files.recordings.entries import ReadBy
    from dbbstation.files.recordings.new_session import FinishedRun, write_session
    from dbbstation.files.recordings.session_details import SessionDetails
    from dbbstation.model.simulation import setup_of, simulate_circle
    from dbbstation.virtual.under_spindle import SetUp, put_up

    if out.exists():
        raise OutputError("the session folder exists already", where=str(out), remedy="choose another name")
    identified = read_model(model, every_source(source_files))
    machine_model = identified.model.of_the_machine()
    inline = read_inline_plan(plan)
    planned = inline.to_domain()
    planned.check(machine_model.machine)
    chosen = chosen_of(planned.name, planned.tests, tests, exclude)
    begun = datetime(2000, 1, 1, tzinfo=UTC)  # a date that nobody takes for a measurement's
    order = [(planned.tests[name], 1) for name in chosen]
    order += [(planned.tests[name], 2) for name in planned.repeat_at_end if name in chosen]
    runs: list[FinishedRun] = []
    for mounting, (test, repeat) in enumerate(order, start=1):
        setup, actual = setup_of(test), machine_model
        if not test.ball.place_known:
            stands = put_up(machine_model, test.circle, setup, SetUp.faultless(), len(runs) * interval_s)
            actual = replace(machine_model, sources=(*machine_model.sources, *stands))
        for direction in test.directions:
            started_s = len(runs) * interval_s
            turn = simulate_circle(actual, test.run(direction), setup, samples, started_s)
            columns = {"t_s": turn.t_s, "length_mm": turn.length_mm, "theta_deg": turn.theta_deg}
            started = begun + timedelta(seconds=started_s)
            runs.append(FinishedRun(test.name, direction, columns, repeat, mounting, started))
    write_session(out, machine_model.machine, inline, runs, SessionDetails(instrument=ReadBy("simulate", virtual=True)))
    if as_json:
        print_json({"session": str(out), "runs": len(runs), "tests": chosen})
    else:
        say(f"{len(runs)} runs written to {out}")
