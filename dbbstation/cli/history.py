"""`dbbstation history`: a folder of sessions as trends, and what changed beyond uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from dbbstation.cli.chosen_tests import chosen_tests_options
from dbbstation.cli.number_types import Finite
from dbbstation.cli.output import echo, echo_line
from dbbstation.cli.source_files import source_file_option

if TYPE_CHECKING:
    from dbbstation.results.history import HistoryResult, MachineHistoryResult, QuantityHistory

MOST_NOTES = 12
"""Notes that the terminal shows; `--json` and `--html` have all."""


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), metavar="FOLDER")
@click.option(
    "--false-alarms",
    type=Finite(1e-6, 0.1),
    default=1e-3,
    show_default=True,
    help="False alarms per session, all quantities of a machine together.",
)
@chosen_tests_options
@source_file_option
@click.option("--rebuild", is_flag=True, help="Read every session anew, whatever the index knows.")
@click.option(
    "--html", "page", type=click.Path(path_type=Path, dir_okay=False), help="Write a page with all trends here."
)
@click.option("--csv", "out", type=click.Path(path_type=Path, dir_okay=False), help="Write every value here, as CSV.")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def history(
    folder: Path,
    *,
    false_alarms: float,
    tests: tuple[str, ...],
    exclude: tuple[str, ...],
    source_files: tuple[Path, ...],
    rebuild: bool,
    page: Path | None,
    out: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    r"""Show what the sessions of a folder say over time, machine by machine, and what changed beyond uncertainty.

    Of every test and direction G, centre X and Y, mean radial error R and centre distance C; parameters of models that lie in
    the folder and come from one of its sessions. Limits are those of the shop's settings. A two-sided CUSUM with a limit for
    single sessions watches each quantity, from its second session on; the rate of false alarms is that of the whole table.
    No model is fitted. What was read is kept in an index in the user's cache folder.

    \b
    Examples:
      dbbstation history sessions
      dbbstation history sessions --html history.html --csv history.csv
      dbbstation history sessions --test a,f --false-alarms 0.0001 --json
    """
    from dbbstation.cli.output import COVERAGE_FACTOR, print_result, say
    from dbbstation.cli.progress import count_bar
    from dbbstation.cli.provenance import provenance
    from dbbstation.cli.shop import shop_settings
    from dbbstation.files.atomic import refuse_outputs, write_bytes
    from dbbstation.files.provenance import refuse_existing_table, write_table
    from dbbstation.files.recordings.table_csv import table_csv
    from dbbstation.history.trend import TrendOptions
    from dbbstation.tasks.history import history as history_of

    refuse_outputs([page, out], force=force)
    if out is not None:
        refuse_existing_table(out, force=force)
    settings = shop_settings()
    asked = TrendOptions(COVERAGE_FACTOR, settings.tolerances, false_alarms, tests, exclude)
    with count_bar("sessions") as counted:
        found = history_of(
            folder, asked, source_files, rebuild=rebuild, progress=lambda _text, done=0, of=0: counted(done, of)
        )
    _say(found)
    if page is not None:
        from dbbstation.report.history_page import history_html

        write_bytes(page, history_html(found, provenance(), settings.tolerances_from), force=force)
        say(f"page written to {page}")
    if out is not None:
        rows = found.rows()
        columns = [["" if row[name] is None else row[name] for row in rows] for name in rows[0]]
        write_table(out, table_csv(list(rows[0]), columns), provenance(), force=force)
        say(f"table written to {out}")
    if as_json:
        print_result(found)
        return
    for machine in found.machines:
        _print(machine, found)


def _say(found: HistoryResult) -> None:
    from dbbstation.cli.output import say

    for one in found.left_out:
        say(f"left out: {one.name}: {one.problem}")
    for note in found.remarks[:MOST_NOTES]:
        say(f"note: {note}")
    if len(found.remarks) > MOST_NOTES:
        say(f"and {len(found.remarks) - MOST_NOTES} more notes, in --json and --html")


def _print(machine: MachineHistoryResult, found: HistoryResult) -> None:
    from dbbstation.cli.output import EXPANDED, print_table
    from dbbstation.report.history_words import changes_in_words, headline

    sessions = machine.sessions
    count = f"{len(sessions)} session{'s' if len(sessions) > 1 else ''}"
    echo_line(f"machine {machine.machine}: {count}, {sessions[0].date} to {sessions[-1].date}")
    if machine.watched_quantities:
        echo(
            f"{machine.watched_quantities} quantities are watched; all together they give {found.false_alarms_per_session:g} false alarms "
            f"per session, {machine.false_alarms_expected:.2g} over this history"
        )
    echo(headline(machine))
    for line in changes_in_words(machine, found.coverage_factor):
        echo(f"  {line}")
    echo(f"\n{EXPANDED}; level: since the last change")
    titles = ["quantity", "unit", "n", "last", "U", "limit", "", "level", "U", "verdict", "since", "by", "U"]
    print_table(titles, [_row(one, found.coverage_factor) for one in machine.quantities])


def _row(one: QuantityHistory, k: float) -> list[object]:
    from dbbstation.report.history_words import verdict_in_words

    last, event = one.values[-1], one.events[-1] if one.events else None
    return [
        one.quantity,
        one.unit,
        len(one.values),
        *_pair(last.value, last.u, k),
        "-" if one.limit is None else f"{one.limit:g}",
        one.conformity or "",
        *_pair(one.level, one.u_level, k),
        verdict_in_words(one),
        "" if event is None else event.since,
        *(("", "") if event is None else _pair(event.difference, event.u_difference, k)),
    ]


def _pair(value: float | None, u: float | None, k: float) -> tuple[str, str]:
    from dbbstation.report.history_words import rounded

    return rounded(value, u, k), rounded(None if u is None else k * u, u, k)
