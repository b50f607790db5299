"""`python -m studies sensitivities`: answers with the constants that decide them halved and doubled."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from studies.sensitivities import Change

_FILE = click.Path(path_type=Path, exists=True, dir_okay=False)
_FOLDER = click.Path(path_type=Path, exists=True, file_okay=False)


@click.command()
@click.argument("drives", metavar="[DRIVE.csv]...", nargs=-1, type=_FILE)
@click.option(
    "--amperes",
    type=(_FILE, click.FloatRange(min=0.0, min_open=True)),
    multiple=True,
    metavar="DRIVE.csv N/A",
    help="Recording of motor current, and the force per ampere [N/A]; may be given more than once.",
)
@click.option(
    "--pair",
    "pairs",
    type=(_FOLDER, _FOLDER),
    multiple=True,
    metavar="A B",
    help="Two sessions to compare; may be given more than once.",
)
@click.option(
    "--table",
    "tables",
    type=(_FILE, str, str),
    multiple=True,
    metavar="TABLE.csv MEASURED SIMULATED",
    help="A table, and the names of its measured and simulated columns; may be given more than once.",
)
@click.option(
    "--only", multiple=True, metavar="NAME", help="Vary this constant; may be given more than once [default: all]."
)
@click.option("--jobs", type=click.IntRange(min=1), help="Number of processes [default: all cores].")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def sensitivities(
    *,
    drives: tuple[Path, ...],
    amperes: tuple[tuple[Path, float], ...],
    pairs: tuple[tuple[Path, Path], ...],
    tables: tuple[tuple[Path, str, str], ...],
    only: tuple[str, ...],
    jobs: int | None,
    as_json: bool,
) -> None:
    r"""Repeat an analysis with every deciding constant halved and doubled.

    Drive recordings use the constants of `drive`, pairs of sessions the constants of `compare`, and tables the
    constants of `mismatch`. The command prints which verdicts change, and which parameter changes most in units of its
    standard uncertainty.

    \b
    Examples:
      python -m studies sensitivities drive.csv
      python -m studies sensitivities --pair before after --jobs 1
      python -m studies sensitivities drive.csv --only APART --only LEAST_SHARE
      python -m studies sensitivities --table room.csv measured_c simulated_c
    """
    from dbbstation.cli.output import print_json
    from dbbstation.cli.progress import count_bar
    from studies.sensitivities import COMPARE, DRIVE, TABLE, study

    if not (drives or amperes or pairs or tables):
        raise click.UsageError("give a drive recording, two sessions with --pair, or a table with --table")
    every = {constant.name for constant in (*DRIVE, *COMPARE, *TABLE)}
    unknown = set(only) - every
    if unknown:
        known = ", ".join(sorted(every))
        raise click.UsageError(f"no constant of this study: {', '.join(sorted(unknown))}; it has {known}")
    recordings = [*((path, None) for path in drives), *amperes]
    with count_bar("answers") as progress:
        changes = study(recordings, pairs, jobs or os.cpu_count() or 1, progress, only, tables)
    if as_json:
        print_json({"changes": [asdict(change) for change in changes]})
    else:
        _print(changes)


def _print(changes: list[Change]) -> None:
    from dbbstation.cli.output import print_table

    print_table(
        ["constant", "own", "tried", "asked of", "verdicts that change", "most [u]", "parameter"],
        [
            [
                change.constant,
                f"{change.own:g}",
                f"{change.tried:g}",
                change.data,
                "; ".join(change.verdicts) or "none",
                f"{change.largest:.2f}",
                change.parameter,
            ]
            for change in changes
        ],
    )
