"""`dbbstation check`: validate files of any format, and whole sessions."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from dbbstation.cli.source_files import source_file_option


@click.command()
@click.argument("files", nargs=-1, type=click.Path(path_type=Path), metavar="FILE...")
@source_file_option
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@click.option("--schema", metavar="FORMAT", help="Print the JSON Schema of a format, such as dbb-plan/2, and stop.")
def check(files: tuple[Path, ...], *, source_files: tuple[Path, ...], as_json: bool, schema: str | None) -> None:
    r"""Validate machines, plans, jigs, models, runs (.csv, .csv.part), recordings of drives and session folders.

    Every fault of every file is listed with line and column. A session is checked with its machine, its plan and all
    its runs: hashes, checksums, units, and whether the machine can travel the plan's circles.

    \b
    Examples:
      dbbstation check plan.yaml machine.yaml
      dbbstation check 2026-11-20-hexapod-7
      dbbstation check --schema dbb-plan/2 > dbb-plan-2.schema.json
    """
    from dbbstation.cli.output import print_json, say
    from dbbstation.errors import InputError

    if schema is not None:
        if files:
            raise click.UsageError("--schema prints a format and takes no files")
        _print_schema(schema)
        return
    if not files:
        raise click.UsageError("name at least one file or session folder")

    from dbbstation.files.checking import check as check_one
    from dbbstation.files.own_sources import every_source

    known = every_source(source_files)
    results = [check_one(file, known) for file in files]
    problems = [problem for result in results for problem in result.problems]
    if as_json:
        print_json(
            {
                "files": [
                    {"file": str(r.path), "format": r.kind, "ok": not r.problems, "summary": r.summary} for r in results
                ],
                "problems": [asdict(problem) for problem in problems],
                "warnings": [asdict(warning) for result in results for warning in result.warnings],
            }
        )
    else:
        for result in results:
            for warning in result.warnings:
                say(f"note: {warning}")
            if not result.problems:
                click.echo(f"ok  {result.path}  {result.summary}")
    if problems:
        raise InputError(set(problems))


def _print_schema(name: str) -> None:
    from dbbstation.cli.output import print_plain_json
    from dbbstation.files.formats.every_format import SCHEMAS, json_schema

    try:
        schema = json_schema(name)
    except KeyError:
        raise click.BadParameter(
            f"{name!r} is no format; there are {', '.join(SCHEMAS)}", param_hint="--schema"
        ) from None
    print_plain_json(schema)
