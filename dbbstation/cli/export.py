"""`dbbstation export`: sessions as one tidy table, CSV or Parquet."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.chosen_tests import chosen_of, chosen_tests_options
from dbbstation.cli.output import echo

if TYPE_CHECKING:
    from dbbstation.files.recordings.entries import RunEntry
    from dbbstation.files.recordings.session import SessionFolder

FORMATS = (".csv", ".parquet")
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
    "--state", "states", multiple=True, type=click.Choice(STATES), help="Runs in this state only  [default: all]."
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

    Columns carry their units in their names. Lengths are raw: nothing is taken off. Where the table comes from stands beside a CSV
    file (.provenance.json) and in the metadata of a Parquet file, which has one row group per run. `dbbstation import` reads the CSV
    back, sample by sample the same.

    \b
    Examples:
      dbbstation export session --out session.csv
      dbbstation export monday tuesday --state accepted --out week.parquet
    """
    from dbbstation.cli.output import print_json, say
    from dbbstation.cli.progress import count_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.provenance import refuse_existing_table
    from dbbstation.files.recordings.session import read_session
    from dbbstation.tasks.export import exporting, write_csv, write_parquet

    if out.suffix.lower() not in FORMATS:
        raise click.UsageError(f"--out {out}: name a file that ends in {' or '.join(FORMATS)}")
    is_csv = out.suffix.lower() == FORMATS[0]
    (refuse_existing_table if is_csv else refuse_existing)(out, force=force)
    runs: list[tuple[SessionFolder, RunEntry]] = []
    for path in sessions:
        session = read_session(path)
        chosen = set(chosen_of(session.plan.name, session.plan.tests, tests, exclude))
        runs += [(session, run) for run in session.runs if run.test in chosen and run.state in (states or STATES)]
    what = exporting(runs)
    with count_bar("export") as progress:
        write = write_csv if is_csv else write_parquet
        rows = write(out, what, provenance, progress, lambda text: say(f"note: {text}"), force=force)
    if as_json:
        print_json({"table": str(out), "runs": len(runs), "rows": rows, "columns": list(what.names)})
    else:
        echo(f"{rows} rows of {len(runs)} runs written to {out}")
