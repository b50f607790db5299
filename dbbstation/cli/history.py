"""`dbbstation history`: trends of a folder of sessions, and changes beyond uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.cli.declared import CommandOutput, command
from dbbstation.cli.output import COVERAGE_FACTOR, EXPANDED, echo, echo_each, echo_line, print_table, provenance
from dbbstation.cli.shop import shop_settings
from dbbstation.tasks.history import history as task
from dbbstation.tasks.telling import silent

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dbbstation.results.history import HistoryResult, MachineHistoryResult, QuantityHistory

MOST_NOTES = 12
"""Greatest number of notes on the terminal; `--json` and `--page` have all."""


def show(found: HistoryResult) -> None:
    """Print the history of every machine."""
    for machine in found.machines:
        _print(machine, found)


def _write_page(found: HistoryResult, path: Path, *, force: bool) -> None:
    from dbbstation.files.atomic import write_bytes
    from dbbstation.report.history_page import history_html

    write_bytes(path, history_html(found, provenance(), shop_settings().tolerances_from), force=force)


def _remarks(found: HistoryResult) -> Iterator[str]:
    yield from (f"left out: {one.name}: {one.problem}" for one in found.left_out)
    yield from (f"note: {note}" for note in found.remarks[:MOST_NOTES])
    if len(found.remarks) > MOST_NOTES:
        yield f"and {len(found.remarks) - MOST_NOTES} more notes, in --json and --page"


def _print(machine: MachineHistoryResult, found: HistoryResult) -> None:
    from dbbstation.report.history_words import changes_in_words, headline

    sessions = machine.sessions
    count = f"{len(sessions)} session{'s' if len(sessions) > 1 else ''}"
    echo_line(f"machine {machine.machine}: {count}, {sessions[0].date} to {sessions[-1].date}")
    if machine.watched_quantities:
        echo(
            f"{machine.watched_quantities} quantities are watched. Expect {found.false_alarms_per_session:g} false alarms per session, "
            f"and {machine.false_alarms_expected:.2g} over this history."
        )
    echo(headline(machine))
    echo_each(f"  {line}" for line in changes_in_words(machine, found.coverage_factor))
    echo(f"\n{EXPANDED}; level: since the last change")
    titles = "quantity, unit, n, last, U, limit, , level, U, verdict, since, by, U"
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
        one.conformity,
        *_pair(one.level, one.u_level, k),
        verdict_in_words(one),
        event and event.since,
        *(("", "") if event is None else _pair(event.difference, event.u_difference, k)),
    ]


def _pair(value: float | None, u: float | None, k: float) -> tuple[str, str]:
    from dbbstation.report.history_words import rounded

    return rounded(value, u, k), rounded(None if u is None else k * u, u, k)


history = command(
    task,
    show,
    CommandOutput("page", write=_write_page, said="page written to {path}"),
    CommandOutput("table", table=True, said="table written to {path}"),
    remarks=_remarks,
    more=lambda: {"tolerances": shop_settings().tolerances, "coverage_factor": COVERAGE_FACTOR, "say": silent},
)
