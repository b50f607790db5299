"""`dbbstation export`: sessions as one tidy table, CSV or Parquet."""

from __future__ import annotations

from pathlib import Path

import click

from dbbstation.cli.output import echo_line
from dbbstation.cli.shared_options import chosen_tests_options

STATES = ("accepted", "complete", "rejected", "recording")


@click.command()
@click.argument("sessions", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="SESSION...")
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path, dir_okay=False),
    help="Table to write: a .csv or .parquet file.",
)
@chosen_tests_options
@click.option(
    "--states", "states", multiple=True, type=click.Choice(STATES), help="Runs in this state only  [default: all]."
)
@click.option("--force", is_flag=True, help="Replace an existing file.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def export(
    sessions: tuple[Path, ...],
    *,
    out: Path,
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    states: tuple[str, ...],
    force: bool,
    as_json: bool,
) -> None:
    r"""Write sessions as one tidy table: one row per sample, with test, direction, repeat, state, time, angle, length, deviation.

    Columns carry their units in their names. Lengths are raw. The provenance is in a file beside a CSV file (.provenance.json), or in the metadata of a Parquet file, which has one row group per run. `dbbstation import` reads the CSV
    back, sample by sample the same.

    \b
    Examples:
      dbbstation export session --out session.csv
      dbbstation export monday tuesday --states accepted --out week.parquet
    """
    from dbbstation.cli.output import print_result, say
    from dbbstation.cli.progress import count_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.tasks.export import FORMATS
    from dbbstation.tasks.export import export as exported

    if out.suffix.lower() not in FORMATS:
        raise click.UsageError(f"--out {out}: name a file that ends in {' or '.join(FORMATS)}")
    with count_bar("export") as progress:
        result = exported(
            sessions,
            out,
            tests=tests,
            exclude=exclude,
            states=states,
            force=force,
            provenance=provenance,
            progress=lambda _, done=0, of=0: progress(done, of),
            say=lambda text: say(f"note: {text}"),
        )
    if as_json:
        print_result(result)
    else:
        echo_line(f"{result.rows} rows of {result.runs} runs written to {out}")
