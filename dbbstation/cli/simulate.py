"""`dbbstation simulate`: noise-free recordings of a plan, as a model predicts them."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.source_files import source_file_option


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
    from dbbstation.cli.output import print_result, say
    from dbbstation.files.own_sources import every_source
    from dbbstation.tasks.simulate import simulate as simulated

    result = simulated(
        model,
        plan,
        out,
        tests=tests,
        exclude=exclude,
        samples=samples,
        interval_s=interval_s,
        known=every_source(source_files),
    )
    if as_json:
        print_result(result)
    else:
        say(f"{result.runs} runs written to {out}")
