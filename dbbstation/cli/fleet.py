"""`dbbstation fleet`: run one task on many sessions, and compare the machines."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from dbbstation.cli.declared import made
from dbbstation.cli.output import echo, print_result, print_table, provenance, say
from dbbstation.cli.progress import count_bar
from dbbstation.cli.shop import shop_settings
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Names, Option

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.results.fleet import FleetResult

ONLY_OF = {
    "sources": ("calibrate", "diagnose"),
    "source_files": ("calibrate", "diagnose"),
    "method": ("calibrate",),
    "law_over_time": ("calibrate",),
    "findings": ("circles",),
}
"""Tasks that have an option; other tasks refuse it."""


@made()
def fleet(
    folders: Annotated[tuple[Path, ...], Option("of sessions.", kind="argument", metavar="FOLDER...")],
    *,
    task: Annotated[Literal["calibrate", "circles", "diagnose", "report"], Option("Task for every session.")],
    sources: Annotated[Names | None, o.SOURCES] = None,
    source_files: o.SourcePaths = (),
    law_over_time: o.LawOverTime = False,
    method: o.Method = "jig",
    findings: o.Findings = False,
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    false_alarms: Annotated[float, Option(o.FALSE_ALARMS, least=1e-6, most=0.5)] = 0.01,
    out: Annotated[Path, replace(o.OUT, kind="folder", metavar="FOLDER")] = Path("fleet"),
    table: Annotated[Path | None, Option(o.TABLE, kind="file")] = None,
    jobs: Annotated[
        int | None, Option("Number of processes on this computer  [default: one for each core].", least=1)
    ] = None,
    scheduler: Annotated[
        str,
        Option(
            "Address of the Dask scheduler that distributes the sessions, such as tcp://server:8786.", metavar="ADDRESS"
        ),
    ] = "",
    apart: Annotated[bool, Option("Count each session without a serial number as a separate machine.")] = False,
    anew: o.Anew = False,
    force: o.Force = False,
    as_json: o.Json = False,
) -> None:
    r"""Run one task on every session of some folders, and show which machines differ from others of their kind.

    The folder --out gets a table (TASK.csv), a page with a row for each machine (TASK.html), and each session's result
    (JSON, model or report). If a session fails, the command names it and continues; the exit code is then 1. Results
    with the same inputs, options and program are reused, so that interrupted work continues.

    \b
    Examples:
      dbbstation fleet sessions --task calibrate
      dbbstation fleet hall-1 hall-2 --task diagnose --out diagnosed --json
      dbbstation fleet sessions --task circles --table circles.parquet   (the table once more, as CSV or Parquet)
      dbbstation fleet /srv/ballbar --task calibrate --scheduler tcp://server:8786
    """
    from dbbstation.files.atomic import refuse_outputs
    from dbbstation.files.formats.settings import Settings
    from dbbstation.tasks.export import FORMATS
    from dbbstation.tasks.fleet import fleet as worked_out
    from dbbstation.tasks.fleet import write_fleet_table
    from dbbstation.tasks.fleet_work import FleetOptions

    of_fit = {"sources": sources, "method": method, "law_over_time": law_over_time, "source_files": source_files}
    given = _of_task(task, of_fit | {"findings": findings, "tests": tests, "exclude": exclude})
    files = tuple(path.absolute() for path in given.pop("source_files", ()))
    options = FleetOptions(given, files, shop_settings() if task == "report" else Settings())
    if table is not None:
        if table.suffix.lower() not in FORMATS:
            raise click.UsageError(f"--table {table}: name a file that ends in {' or '.join(FORMATS)}")
        refuse_outputs([table], force=force)
    with count_bar(f"sessions: {task}") as progress:
        result = worked_out(
            folders,
            task,
            out,
            options=options,
            processes=jobs or os.cpu_count() or 1,
            scheduler=scheduler,
            false_alarms=false_alarms,
            apart=apart,
            anew=anew,
            provenance=provenance,
            progress=lambda _, done=0, of=0: progress(done, of),
            say=say,
        )
    if table is not None:
        write_fleet_table(table, result, provenance(), force=force)
    if as_json:
        print_result(result)
    else:
        _print(result)
    if result.failed:
        raise click.exceptions.Exit(1)


def _of_task(task: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the given options; refuse an option that the task does not have."""
    source = click.get_current_context().get_parameter_source
    given = [name for name in options if source(name) is click.core.ParameterSource.COMMANDLINE]
    for name in given:
        if task not in ONLY_OF.get(name, (task,)):
            flag = f"--{name.replace('_', '-')}"
            raise click.UsageError(f"{flag} is an option of {' and '.join(ONLY_OF[name])}, not of {task}")
    return {name: options[name] for name in given}


def _print(result: FleetResult) -> None:
    from dbbstation.report.fleet_page import headline_of

    rows = [
        [one.machine, one.session, one.state, (one.problem or one.headline).splitlines()[0]] for one in result.sessions
    ]
    print_table("machine, session, state, result", rows)
    echo()
    echo(headline_of(result))
    comparison = result.comparison
    if comparison is not None:
        if comparison.quantities:
            echo(
                f"{comparison.quantities} quantities compared; like machines show any unlike value with a probability of "
                f"{comparison.false_alarms:g}"
            )
        for one in comparison.unlike:
            u = "" if one.uncertainty is None else f" (u {one.uncertainty:.2g})"
            echo(
                f"  {one.machine}: {one.quantity} {one.value:.4g}{u} {one.unit}, the others {one.usual:.4g} with a scatter of "
                f"{one.scatter:.2g}"
            )
        for cause in comparison.causes:
            echo(
                f"  {cause.name}: found in {len(cause.found_in)} of {cause.machines}, {', '.join(cause.found_in)} "
                f"({cause.false_claims:.2g} false claims expected)"
            )
        for note in comparison.notes:
            echo(f"note: {note}")
    echo(f"table: {result.table}")
    echo(f"page:  {result.page}")
