"""`dbbstation import`: import other programs' recordings as a session."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import click

from dbbstation.cli.declared import made
from dbbstation.cli.mapping_options import MappingOptions, chosen_mapping, read_tables
from dbbstation.cli.output import echo, echo_line, print_result, print_table, provenance
from dbbstation.cli.session_options import SessionOptions
from dbbstation.computing.grouped import grouped
from dbbstation.errors import InputError, OutputError
from dbbstation.tasks import options as o
from dbbstation.tasks.declare import Option
from dbbstation.text.written import printable, repeats_in_order

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.cli.asking import Asker
    from dbbstation.files.formats.mapping import MappingFile
    from dbbstation.files.recordings.foreign_csv import ForeignTable
    from dbbstation.plan.plan import Plan
    from dbbstation.results.exchange import ImportResult
    from dbbstation.tasks.importing.names import RunName
    from dbbstation.tasks.importing.runs import ImportedRun, Reader
    from dbbstation.tasks.importing.session import ImportedSession

CONDITIONS = ("temperature", "operator", "job", "bar")
"""Conditions that a session notes and tables lack."""


@made("import")
def import_(
    of_mapping: MappingOptions,
    noted: SessionOptions,
    *,
    files: Annotated[tuple[Path, ...], Option("recordings.", kind="argument", metavar="FILE.csv...")],
    out: Annotated[Path, replace(o.OUT, kind="folder", metavar="SESSION")],
    plan: Annotated[Path | None, o.PLAN] = None,
    machine: Annotated[Path | None, o.MACHINE] = None,
    runs: Annotated[
        tuple[str, ...],
        Option(
            "Run in a file that does not name it, such as old1.csv=a-ccw or old1.csv=a-ccw-2. Several runs of a file follow in their order.",
            metavar="FILE=TEST-DIRECTION,...",
            whole=True,
        ),
    ] = (),
    started: Annotated[
        tuple[str, ...],
        Option(
            "Start of a file's first run, such as 2026-11-20T08:04+01:00, if the file does not state it.",
            metavar="[FILE=]TIME",
            whole=True,
        ),
    ] = (),
    trust: Annotated[
        tuple[Literal["unit", "centre"], ...],
        Option(
            "Accept numbers that seem to have another unit, or circles that seem centred. The session notes this.",
            whole=True,
        ),
    ] = (),
    not_known: Annotated[
        tuple[Literal["temperature", "operator", "job", "bar"], ...],
        Option("Name of a condition that is unknown; the session notes this. May be given more than once.", whole=True),
    ] = (),
    yes: Annotated[bool, Option("Write without asking.")] = False,
    dry_run: o.DryRun = False,
    as_json: o.Json = False,
) -> None:
    r"""Import recordings of another program into a sealed session.

    The recordings are tables with angle or time, and deviation or length. The program guesses the columns' meanings
    from their names, shows them, and keeps them in the file of --mapping. On a terminal the program asks for missing
    facts; in a pipe, options must state them. Computed values, such as times from angles at the plan's feed, are
    reported and noted in the session. The session's folder `imported` keeps the original files, the mapping and all
    stated facts.

    \b
    Examples:
      dbbstation import old/*.csv --out imported --plan table2.yaml --machine machine.yaml --mapping old-program.yaml \
        --ambient-temp-c 20.4 --operator Mori --not-known job --not-known bar --yes
      dbbstation import a.csv --out imported --plan table2.yaml --machine machine.yaml --runs a.csv=a-ccw \
        --columns Winkel=angle:deg --columns Abweichung=deviation:µm --zero-mm 150 --angle-grows ccw --angle-zero-deg 0 \
        --ambient-temp-c 20.4 --operator Mori --not-known job --not-known bar --dry-run
    """
    from dbbstation.cli.asking import Asker
    from dbbstation.files.atomic import refuse_existing
    from dbbstation.files.formats.mapping import write_mapping
    from dbbstation.tasks.importing.session import staged

    if out.exists():
        raise OutputError("the session folder exists already", where=str(out), remedy="choose another name")
    remembered = of_mapping.mapping
    if remembered is not None and remembered.exists():
        remembered = None
    elif remembered is not None:
        refuse_existing(remembered, force=False)
    asker = Asker()
    told = _Told(runs, started, frozenset(trust), not_known)
    found = _read(asker, files, of_mapping, (plan, machine), told, noted)
    with staged(out, found, dry=dry_run) as put:
        if not as_json:
            _show(found)
        if not dry_run:
            _confirm(asker, f"write {len(found.runs)} runs to {out}?", yes=yes)
            put()
            if remembered is not None:
                write_mapping(remembered, found.mapping)
    if as_json:
        print_result(_result(found, out, written=not dry_run))
    elif dry_run:
        echo("nothing was written (--dry-run)")
    else:
        kept = "" if remembered is None else f", the mapping to {remembered}"
        echo_line(f"{len(found.runs)} runs written to {out}{kept}")


@dataclass(frozen=True)
class _Told:
    named: Sequence[str]
    started: Sequence[str]
    trusted: frozenset[str]
    not_known: Sequence[str]


def _read(
    asker: Asker,
    files: Sequence[Path],
    of_mapping: MappingOptions,
    paths: tuple[Path | None, Path | None],
    said: _Told,
    noted: SessionOptions,
) -> ImportedSession:
    from dbbstation.files.formats.machine import read_machine
    from dbbstation.files.formats.plan import read_inline_plan
    from dbbstation.files.formats.session import Note
    from dbbstation.tasks.importing.runs import Reader
    from dbbstation.tasks.importing.session import ImportedSession, originals

    tables = read_tables(files, of_mapping)
    chosen = chosen_mapping(list(tables.values()), of_mapping, asker)
    plan = paths[0] or Path(asker.text("test plan whose circles were run", "--plan"))
    machine = paths[1] or Path(asker.text("file of the machine", "--machine"))
    noted = _with_conditions(asker, noted, said.not_known)
    asker.check()
    mapping, inline, nominal = chosen(), read_inline_plan(plan), read_machine(machine)
    planned = inline.to_domain()
    told = _told(files, said.named, planned)
    started = _started(files, said.started, mapping.zone)
    reader = Reader(_split(asker, mapping, list(tables.values())), planned, started, said.trusted)
    reader = _with_span(asker, reader, list(tables.values()))
    mapping = reader.mapping
    runs: list[ImportedRun] = []
    for path, table in tables.items():
        runs += reader.read(table, told.get(path) or [_asked_run(asker, reader, table, planned)])
    reader.check()
    places = {one.run.key: one for one in runs}
    runs = [places[one.key] for one in repeats_in_order(one.run for one in runs)]
    trusted = [f"taken as they are, whatever they look like: {one}" for one in sorted(said.trusted)]
    centred = [] if "centre" in said.trusted else _asked_centres(asker, runs, planned)
    statements = [*_statements(mapping, runs, _unknown(noted)), *trusted, *centred, *reader.left_out]
    now = datetime.now(UTC).replace(microsecond=0)
    notes = tuple(Note(now, f"imported: {text}") for text in statements)
    details = replace(noted.details(), notes=notes)
    more = originals({path: table.data for path, table in tables.items()}, mapping, provenance(), statements)
    return ImportedSession(mapping, inline, nominal, runs, details, statements, more)


def _confirm(asker: Asker, question: str, *, yes: bool) -> None:
    if not yes and not asker.terminal:
        raise click.UsageError("nothing was written: give --yes to write the session, or --dry-run to show it only")
    if not yes:
        click.confirm(printable(question), abort=True, err=True)


def _result(found: ImportedSession, out: Path, *, written: bool) -> ImportResult:
    from dbbstation.results.exchange import ImportResult, TakenRun

    runs = tuple(
        TakenRun(Path(one.file).name, one.run.label, len(one.run.columns.get("t_s", ())), tuple(one.computed))
        for one in found.runs
    )
    mapping = found.mapping.model_dump(exclude_none=True)
    return ImportResult(str(out), written, mapping, runs, tuple(found.statements))


def _with_conditions(asker: Asker, told: SessionOptions, not_known: Sequence[str]) -> SessionOptions:
    asked_for = set(_unknown(told)) - set(not_known)
    if "temperature" in asked_for:
        asked = asker.number("temperature of the shop [degC]", "--ambient-temp-c, or --not-known temperature")
        told = replace(told, ambient_temp_c=asked)
    if "operator" in asked_for:
        told = replace(told, operator=asker.text("who measured", "--operator, or --not-known operator", default=""))
    if "job" in asked_for:
        told = replace(told, job=asker.text("what it was measured for", "--job, or --not-known job", default=""))
    if "bar" in asked_for:
        option = "--bar FILE, or --bar-length-mm with --bar-uncertainty-um, or --not-known bar"
        length_mm = asker.number("calibrated length of the bar [mm]", option)
        told = replace(told, bar_length_mm=length_mm)
        if length_mm is not None:
            u_um = asker.number("its standard uncertainty [µm]", "--bar-uncertainty-um")
            told = replace(told, bar_uncertainty_um=u_um)
    return told


def _unknown(told: SessionOptions) -> list[str]:
    has_bar = told.bar is not None or told.bar_length_mm is not None
    known = (told.ambient_temp_c is not None, bool(told.operator), bool(told.job), has_bar)
    return [one for one, is_known in zip(CONDITIONS, known, strict=True) if not is_known]


def _told(files: Sequence[Path], named: Sequence[str], plan: Plan) -> dict[Path, list[RunName]]:
    from dbbstation.tasks.importing.names import run_name

    found: dict[Path, list[RunName]] = {}
    for text in named:
        name, _, said = text.rpartition("=")
        matching = [path for path in files if name in {str(path), path.name}]
        runs = [run for one in said.split(",") if (run := run_name(one.strip(), list(plan.tests))) is not None]
        if len(matching) != 1:
            raise click.UsageError(f"--runs {text}: {len(matching)} of the given files have the name {name!r}")
        if len(runs) != len(said.split(",")):
            raise click.UsageError(
                f"--runs {text}: {said} is no run of the plan, whose tests are {', '.join(plan.tests)}"
            )
        found[matching[0]] = [*found.get(matching[0], []), *runs]
    return found


def _asked_run(asker: Asker, reader: Reader, table: ForeignTable, plan: Plan) -> RunName:
    from dbbstation.tasks.importing.names import RunName, run_name

    if not asker.terminal or reader.says_test(table):
        return RunName()
    while True:
        answer = asker.text(
            f"which run is {Path(table.table.file).name}, such as {next(iter(plan.tests))}-ccw", "--runs"
        )
        found = run_name(answer, list(plan.tests))
        if found is not None:
            return found
        echo(f"the plan's tests: {', '.join(plan.tests)}; directions: ccw, cw", err=True)


def _started(files: Sequence[Path], said: Sequence[str], zone: str | None) -> dict[str, datetime]:
    from dbbstation.tasks.importing.moments import UnclearMomentError, moment_in, zone_named

    found: dict[str, datetime] = {}
    for text in said:
        name, has, when = text.rpartition("=")
        matching = [path for path in files if not has or name in {str(path), path.name}]
        if len(matching) != 1:
            raise click.UsageError(
                f"--started {text}: it applies to {len(matching)} of the given files; write FILE=TIME"
            )
        try:
            found[str(matching[0])] = moment_in(when, None if zone is None else zone_named(zone)).at
        except UnclearMomentError as error:
            raise click.UsageError(
                f"--started {text}: {error.what}; write such as 2026-11-20T08:04:11+01:00"
            ) from error
    return found


def _split(asker: Asker, mapping: MappingFile, tables: Sequence[ForeignTable]) -> MappingFile:
    import numpy as np

    from dbbstation.files.formats.mapping import ANGLE, OF_RUNS
    from dbbstation.tasks.importing.splitting import parts_by_direction

    name = mapping.column(ANGLE)
    told = mapping.split is not None or any(mapping.column(one) is not None for one in OF_RUNS)
    if not asker.terminal or told or name is None or mapping.columns[name].unit != "deg":
        return mapping
    for table in tables:
        angle = table.table.values.get(name, np.zeros(0))
        parts = parts_by_direction(angle[np.isfinite(angle)])
        if len(parts) > 1:
            file = Path(table.table.file).name
            if not click.confirm(f"the angles of {file} turn round: has it {len(parts)} runs", err=True):
                raise click.UsageError("a run turns in one direction: check the file")
            return mapping.model_copy(update={"split": "direction"})
    return mapping


def _asked_centres(asker: Asker, runs: Sequence[ImportedRun], plan: Plan) -> list[str]:
    from dbbstation.tasks.importing.plausible import CHANCE
    from dbbstation.tasks.importing.runs import chance_of_runs

    chance = chance_of_runs(runs, plan)
    if chance is None or chance >= CHANCE:
        return []
    what = (
        f"the circles lie nearer to their commanded centres than balls can be put up (probability by chance {chance:.1g}): another program "
        "took the centre off"
    )
    remedy = (
        "export raw data; or import with a plan whose balls are `placed: under-spindle`, which needs no centre; --trust centre takes them "
        "as they are"
    )
    if not asker.terminal:
        raise InputError.of(runs[0].file, what, remedy)
    if not click.confirm(printable(f"{what}. Are they raw all the same"), err=True):
        raise click.UsageError(remedy)
    return [f"centres: {what}; they were confirmed to be raw"]


def _with_span(asker: Asker, reader: Reader, tables: Sequence[ForeignTable]) -> Reader:
    angle = reader.mapping.angle
    if angle is None or angle.span_deg is not None or not asker.terminal:
        return reader
    spans = {path.table.file: span for path in tables if (span := reader.asked_span_deg(path)) is not None}
    if not spans:
        return reader
    file, span = next(iter(spans.items()))
    question = (
        f"the angles of {Path(file).name} span {span:.0f} degrees, those of no circle of the plan do: is that right"
    )
    if not click.confirm(f"{question} (one turn counts)", err=True):
        raise click.UsageError("check plan and files: a run is one turn, or one turn with the plan's overshoot")
    stated = angle.model_copy(update={"span_deg": round(span, 1)})
    return replace(reader, mapping=reader.mapping.model_copy(update={"angle": stated}))


def _statements(mapping: MappingFile, runs: Sequence[ImportedRun], unknown: Sequence[str]) -> list[str]:
    from dbbstation.files.formats.mapping import ANGLE, DEVIATION

    files = ", ".join(dict.fromkeys(Path(one.file).name for one in runs))
    found = [f"from {files}: kept in the folder `imported`"]
    if mapping.column(DEVIATION) is not None:
        found.append(f"lengths are the deviations plus {mapping.zero_mm} mm, a positive deviation is a longer bar")
    if mapping.column(ANGLE) is not None and mapping.angle is not None:
        zero = "the start of the turn" if mapping.angle.zero_deg is None else f"{mapping.angle.zero_deg:g} degrees"
        found.append(f"angle 0 of the files is {zero}, their angles grow with {mapping.angle.grows}")
    for text, names in grouped((text, one.run.label) for one in runs for text in one.computed).items():
        found.append(f"{text} ({'every run' if len(names) == len(runs) else ', '.join(names)})")
    return [*found, *(f"not stated: {one}" for one in unknown)]


def _show(found: ImportedSession) -> None:
    from dbbstation.trace.columns import LENGTH, TIME

    print_table("column, means, unit", [[name, one.means, one.unit] for name, one in found.mapping.columns.items()])
    echo()
    rows = []
    for one in found.runs:
        length, t_s = one.run.columns[LENGTH], one.run.columns[TIME]
        span = f"{float(length.min()):.4f} to {float(length.max()):.4f}"
        rows.append(
            [Path(one.file).name, one.run.label, str(len(t_s)), f"{t_s[-1] - t_s[0]:.2f}", span, one.run.state.value]
        )
    print_table("file, run, samples, t [s], length [mm], state", rows)
    details = found.details
    bar = "not known" if details.bar is None else f"{details.bar.calibrated_length_mm:.4f} mm"
    temp = "not known" if details.ambient_temp_c is None else f"{details.ambient_temp_c:g} degC"
    people = f"operator {details.operator or 'not known'}, job {details.job or 'not known'}"
    echo(f"\n{people}, temperature {temp}, bar {bar}")
    for text in found.statements:
        echo_line(f"- {text}")
