"""`dbbstation check`: validate files of any format, and whole sessions."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click

from dbbstation.cli.declared import made
from dbbstation.cli.instrument_options import INSTRUMENT, PROFILE
from dbbstation.cli.output import echo, echo_line, print_plain_json, print_result, say
from dbbstation.cli.progress import count_bar
from dbbstation.errors import InputError, Problem, refuse
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Names, Option

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.files.checking import Checked
    from dbbstation.results.checked import CheckedFile, DryRunResult, SampledPlanResult
    from dbbstation.sources.contract import ErrorSource


def _anchor(text: str) -> str:
    if re.fullmatch(r"[0-9a-f]{16,64}", text.lower()):
        return text.lower()
    raise ValueError(
        "give sixteen to sixty-four hexadecimal digits, as in a report or in the output of `dbbstation check`"
    )


@made()
def check(
    files: Annotated[tuple[Path, ...], Option("of any format.", kind="argument", metavar="FILE...")] = (),
    *,
    source_files: o.SourcePaths = (),
    tests: o.Tests = (),
    exclude: o.Exclude = (),
    step_deg: o.StepDeg = 0.1,
    clearance_mm: o.ClearanceMm = 20.0,
    bar_stays_on: o.BarStaysOn = False,
    instrument: Annotated[str | None, replace(INSTRUMENT, setting="")] = None,
    profile: Annotated[str | None, replace(PROFILE, setting="")] = None,
    anchor: Annotated[
        str | None,
        Option("State whether the sessions were changed since this anchor was noted.", metavar="HASH", parse=_anchor),
    ] = None,
    schema: Annotated[
        str | None,
        Option(
            "Print a JSON Schema and stop. FORMAT is a file format, such as dbb-plan/1, or a command with --json, such as calibrate.",
            metavar="FORMAT",
        ),
    ] = None,
    as_json: o.Json = False,
) -> None:
    r"""Validate machines, instruments, plans, jigs, models, settings, runs (.csv, .csv.part), recordings of drives and session folders.

    Every fault of every file is listed with line and column. A session is checked with its machine, its plan and all
    its runs: hashes, checksums, units, and whether the machine can travel the plan's circles. Its runs are judged as by `dbbstation circles --findings` without a model. Findings are printed as notes.

    With plans and one machine, the command also makes a dry run. The dry run checks travel and feeds along the whole
    path of every program that `dbbstation program` would write.

    The summary of a session ends with its anchor, the hash of the last event of its log. Note the anchor elsewhere, as
    reports do. With --anchor HASH the command reports later changes; sixteen digits of the anchor are enough.

    With --instrument, the command states the points per turn at each plan's feeds, and the figures that these points do
    not resolve.

    \b
    Examples:
      dbbstation check plan.yaml machine.yaml
      dbbstation check plan.yaml --instrument heidenhain-nd281b
      dbbstation check my-gauge.yaml
      dbbstation check plan.yaml machine.yaml --exclude high --clearance-mm 50
      dbbstation check 2026-11-20-hexapod-7
      dbbstation check 2026-11-20-hexapod-7 --anchor 3f2a9c1b2d4e5f60
      dbbstation check --schema dbb-plan/1 > dbb-plan-1.schema.json
    """
    if schema is not None:
        if files:
            raise click.UsageError("--schema prints a format and takes no files")
        _print_schema(schema)
        return
    if not files:
        raise click.UsageError("name at least one file or session folder")

    from dbbstation.files.own_sources import every_source
    from dbbstation.results.checked import CheckResult

    known = every_source(source_files)
    results = [_check_one(file, known) for file in files]
    _hold_against(results, anchor)
    machines = _sound(results, "dbb-machine")
    # Of several machines nobody has said which the plans are for.
    runs = [
        _dry_run(plan, machine, tests, exclude, step_deg, None if bar_stays_on else clearance_mm)
        for plan in _sound(results, "dbb-plan")
        for machine in (machines if len(machines) == 1 else ())
    ]
    if (tests or exclude) and not runs:
        raise click.UsageError(
            "--tests and --exclude choose tests of a dry run: give plans and one machine, without faults"
        )
    if profile is not None and instrument is None:
        raise click.UsageError("--profile needs --instrument")
    seen = [] if instrument is None else _seen(_sound(results, "dbb-plan"), instrument, profile)
    problems = [problem for result in results for problem in result.problems]
    problems += [problem for run in runs for problem in run.problems]
    if as_json:
        checked, warnings = map(_file, results), (warning for result in results for warning in result.warnings)
        print_result(CheckResult(tuple(checked), tuple(runs), tuple(seen), tuple(problems), tuple(warnings)))
    else:
        _print(results, runs)
        for one in seen:
            for note in one.notes:
                echo(f"{one.plan}: {note}")
    refuse(set(problems))


def _hold_against(results: Sequence[Checked], anchor: str | None) -> None:
    from dbbstation.files.recordings.event_log import anchor_told

    for result in results:
        if anchor is not None and result.kind.startswith("dbb-session"):
            folder = result.path if result.path.is_dir() else result.path.parent
            told = anchor_told(folder, anchor)
            (result.problems if told.remedy else result.warnings).append(told)


def _file(result: Checked) -> CheckedFile:
    from dbbstation.results.checked import CheckedFile, CheckedRun

    runs = tuple(CheckedRun(one.run.label, tuple(one.findings)) for one in result.judgements)
    return CheckedFile(str(result.path), result.kind, not result.problems, result.summary, runs or None, result.virtual)


def _print(results: Sequence[Checked], runs: Sequence[DryRunResult]) -> None:
    for result in results:
        for warning in result.warnings:
            say(f"note: {warning}")
        if not result.problems:
            echo_line(f"ok  {result.path}  {result.summary}")
    for run in runs:
        if not run.problems:
            echo_line(f"ok  {run.plan} on {run.machine}  dry run: {run.programs} programs within travel and feeds")


def _seen(plans: Sequence[Path], instrument: str, profile: str | None) -> list[SampledPlanResult]:
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.instrument.library import load_instrument
    from dbbstation.plan.sampling import sampled_circles, sampling_notes
    from dbbstation.results.checked import SampledPlanResult

    protocol = load_instrument(instrument, profile)
    rate_hz = protocol.fastest_hz()
    read = [(file, read_plan(file)) for file in plans]
    return [
        SampledPlanResult(
            str(file), sampled_circles(plan, rate_hz), tuple(sampling_notes(plan, protocol.label, rate_hz))
        )
        for file, plan in read
    ]


def _check_one(file: Path, known: Mapping[str, ErrorSource]) -> Checked:
    from dbbstation.files.checking import Checked, check
    from dbbstation.files.yaml.text import load_yaml

    document = load_yaml(file, []) if file.suffix in {".yaml", ".yml"} else None
    given = str(document.data.get("format", "")) if document is not None and isinstance(document.data, dict) else ""
    if given.startswith("dbb-job/"):
        from dbbstation.service.operated import instrument_faults

        checked = check(file, known)
        checked.problems += [] if checked.problems else instrument_faults(file)
        return checked
    if not given.startswith("dbb-instrument/"):
        return check(file, known)
    from dbbstation.instrument.library import load_variants

    checked = Checked(file, kind=given)
    try:
        variants = load_variants(file)
    except InputError as error:
        checked.problems += error.problems
    else:
        names = ", ".join(one.profile for one in variants if one.profile)
        checked.summary = f"instrument {variants[0].name}" + (f": {names}" if names else "")
    return checked


def _sound(results: Sequence[Checked], kind: str) -> list[Path]:
    return [one.path for one in results if one.kind.partition("/")[0] == kind and not one.problems]


def _dry_run(
    plan_file: Path,
    machine_file: Path,
    tests: Names,
    exclude: Names,
    step_deg: float,
    clearance_mm: float | None,
) -> DryRunResult:
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_plan
    from dbbstation.nc.circle_programs import dry_run
    from dbbstation.plan.plan import chosen_of
    from dbbstation.results.checked import DryRunResult

    plan, machine = read_plan(plan_file), read_machine(machine_file)
    chosen = chosen_of(plan.name, plan.tests, tests, exclude)
    with count_bar("programs") as trying:
        count, faults = dry_run(
            plan, machine, tests=chosen, step_deg=step_deg, clearance_mm=clearance_mm, progress=trying
        )
    on = f"on {machine_file}: "
    problems = tuple(Problem.of(plan_file, f"{on}{fault.where}: {fault.what}", fault.remedy) for fault in faults)
    return DryRunResult(str(plan_file), str(machine_file), count, not problems, problems)


def _print_schema(name: str) -> None:
    from dbbstation.files.checking import SCHEMAS, json_schema
    from dbbstation.instrument.library import ProtocolFile
    from dbbstation.results.schemas import RESULTS, result_schema

    formats: Any = {**SCHEMAS, "dbb-instrument/1": ProtocolFile}
    if name in RESULTS:
        print_plain_json(result_schema(name))
    elif name in formats:
        print_plain_json(json_schema(name, formats[name]))
    else:
        what = f"{name!r} is no format; there are {', '.join(sorted(formats))}, and of `--json` {', '.join(RESULTS)}"
        raise click.BadParameter(what, param_hint="--schema")
