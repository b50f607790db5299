"""`python -m studies history`: false alarms and delays of what watches a machine over its sessions."""

from __future__ import annotations

from typing import Any

import click


@click.command()
@click.option(
    "--tables", default=600, show_default=True, type=click.IntRange(min=20), help="Histories without a change."
)
@click.option("--quantities", default=90, show_default=True, type=click.IntRange(min=1), help="Quantities of each.")
@click.option(
    "--sessions", "length", default=520, show_default=True, type=click.IntRange(min=20), help="Sessions of each."
)
@click.option(
    "--changes", default=300, show_default=True, type=click.IntRange(min=10), help="Histories per kind of change."
)
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0), help="Seed of all histories.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def history(*, tables: int, quantities: int, length: int, changes: int, seed: int, as_json: bool) -> None:
    r"""Simulate histories: how many raise a false alarm, and how soon steps and drifts are found.

    The stated share of false alarms comes from the Markov chain. It holds for the whole table and for this number of sessions.
    Delays are given for one quantity of such a table, also with other settings than the program's.

    \b
    Examples:
      python -m studies history
      python -m studies history --tables 100 --quantities 10 --changes 50 --json
    """
    from dbbstation.cli.output import print_json
    from dbbstation.cli.progress import count_bar
    from dbbstation.history.trend import FALSE_ALARMS
    from studies.history import Size, study

    with count_bar("histories") as progress:
        found = study(Size(tables, quantities, length, FALSE_ALARMS, changes, seed), progress=progress)
    if as_json:
        print_json(found)
    else:
        _print(found)


def _print(found: dict[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    click.echo(
        f"{found['tables']} histories without a change, {found['quantities']} quantities, {found['sessions']} sessions, "
        f"{found['false_alarms_per_session']:g} false alarms per session: share with an alarm"
    )
    rows: list[list[object]] = []
    for one in found["false_alarms"]:
        low, high = (f"{100 * share:.1f}" for share in one["interval"])
        rows.append([f"{one['scatter_in_u']:g} u", 100 * one["stated"], 100 * one["found"], f"{low} to {high}"])
    print_table(["sessions scatter by", "stated [%]", "found [%]", "95 % interval"], rows)
    ways = list(dict.fromkeys(one["way"] for one in found["delays"]))
    before = list(dict.fromkeys(one["sessions_before"] for one in found["delays"]))
    click.echo(
        f"\nsessions until a change is found, median of {found['histories_per_change']} histories (and how many % are found)"
    )
    rows = []
    for way in ways:
        of = [one for one in found["delays"] if one["way"] == way]
        for change in dict.fromkeys(one["change"] for one in of):
            cells = {one["sessions_before"]: _cell(one) for one in of if one["change"] == change}
            rows.append([way, change, *(cells[count] for count in before)])
    print_table(["way", "change", *(f"after {count}" for count in before)], rows)
    _print_few(found)


def _print_few(found: dict[str, Any]) -> None:
    from dbbstation.cli.output import print_table

    few = found["few_sessions"]
    click.echo(
        "\nfew sessions, decided by stated uncertainty: tables with a false alarm [%], by what sessions scatter by"
    )
    scatters = [one["scatter_in_u"] for one in few[0]["false_alarms"]]
    rows: list[list[object]] = [
        [
            one["sessions"],
            *(_share(alarms["found"]) for alarms in one["false_alarms"]),
            _share(one["false_alarms"][0]["stated"]),
        ]
        for one in few
    ]
    print_table(["sessions", *(f"{scatter:g} u" for scatter in scatters), "stated"], rows)
    click.echo("\na step in the last of them, in u: found at once [%]")
    steps = list(few[0]["found_by_step"])
    rows = [[one["sessions"], *(_share(one["found_by_step"][step]) for step in steps)] for one in few]
    print_table(["sessions", *steps], rows)


def _share(share: float) -> str:
    return f"{100 * share:.2g}"


def _cell(one: dict[str, Any]) -> str:
    if one["found"] is None:
        return "-"
    delay = "-" if one["median_delay"] is None else f"{one['median_delay']:.0f}"
    return f"{delay} ({100 * one['found']:.0f})"
