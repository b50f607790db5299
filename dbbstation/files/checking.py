"""Check files of any format and whole sessions, for `dbbstation check`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.errors import Faults, InputError, Problem, TravelError, few
from dbbstation.facts.serialise import adapter
from dbbstation.files.formats.bar import BarFile, parse_bar
from dbbstation.files.formats.jig import JigFile, parse_jig
from dbbstation.files.formats.job import JobFile, parse_job
from dbbstation.files.formats.machine import MachineFile, parse_machine
from dbbstation.files.formats.mapping import MappingFile, parse_mapping
from dbbstation.files.formats.model import ModelFile, parse_model
from dbbstation.files.formats.plan import PlanFile, parse_plan
from dbbstation.files.formats.session import PART, RunState, SessionFile
from dbbstation.files.formats.settings import read_settings
from dbbstation.files.formats.settings_schema import SettingsFile
from dbbstation.files.formats.simulator import SimulatorFile, parse_simulator
from dbbstation.files.inputs import open_book
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.drive_csv import looks_like_drive, read_drive
from dbbstation.files.recordings.event_log import SHORTEST, anchor_of, read_event_log, set_back
from dbbstation.files.recordings.judged import JUDGED, judge_session
from dbbstation.files.recordings.run_csv import read_run
from dbbstation.files.recordings.seal import copy_faults
from dbbstation.files.recordings.session import SessionFolder, no_session, parse_session, unlisted_sealed
from dbbstation.files.yaml.schema import format_of
from dbbstation.files.yaml.text import load_yaml
from dbbstation.plan.bar import BAR_LENGTH
from dbbstation.quality.finding import Name
from dbbstation.trace.recording import lost_samples

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from dbbstation.facts.record import Record
    from dbbstation.files.formats.session import RunEntry
    from dbbstation.files.yaml.schema import Schema
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.quality.judge import Judgement
    from dbbstation.sources.contract import ErrorSource
    from dbbstation.trace.recording import Recording


def json_schema(name: str, schema: type[Schema | Record]) -> dict[str, object]:
    """Return the JSON Schema of a format such as `dbb-plan/1`, with units and plausible ranges."""
    described = adapter(schema).json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **described, "title": name}


FEWEST_SAMPLES = 8
"""Least number of samples of a circle: centre, radius, ellipse and triangle are seven numbers."""


NC_PROGRAM = "an NC program", "dbbstation compensate PROGRAM --model MODEL.yaml --out FILE"
OTHERS = {
    **dict.fromkeys((".ngc", ".nc", ".tap", ".cnc", ".gcode", ".gc", ".eia", ".mpf"), NC_PROGRAM),
    ".dmo": ("a CMM sheet", "dbbstation jig sheet SHEET --jig OLD.yaml --out NEW.yaml"),
    ".parquet": ("a table", "dbbstation mismatch TABLE --measured COLUMN --simulated COLUMN"),
}
"""Files that other commands read: kind and command, by suffix."""


@dataclass
class Checked:
    """Result for one file or session.

    Attributes:
        kind: format; `run`, `drive`, or empty if unknown.
        summary: one line; empty if there are problems.
        judgements: of accepted and waiting runs of a session; else empty.
        virtual: whether a session is of a virtual machine; None if unknown.
    """

    path: Path
    kind: str = ""
    summary: str = ""
    problems: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)
    judgements: tuple[Judgement, ...] = ()
    virtual: bool | None = None


def check(path: Path, known_sources: Mapping[str, ErrorSource]) -> Checked:
    """Check one file of any format, or a session folder."""
    checked = Checked(path)
    try:
        _look(checked, known_sources)
    except InputError as error:
        checked.problems += error.problems
    if checked.problems:
        checked.summary = ""
    return checked


def _look(checked: Checked, known_sources: Mapping[str, ErrorSource]) -> None:
    path = checked.path
    if path.is_dir():
        if (path / SESSION_FILE).exists():
            document = load_yaml(path / SESSION_FILE, [])
            data = document.data if document is not None and isinstance(document.data, dict) else {}
            checked.kind = str(data.get("format", "dbb-session"))
            _session(checked)
        else:
            checked.problems.append(no_session(path))
    elif path.suffixes[-1:] == [".csv"] or path.suffixes[-2:] == [".csv", PART]:
        checked.kind = "drive" if looks_like_drive(path) else "run"
        if checked.kind == "drive":
            _drive(checked)
        else:
            _run(checked)
    else:
        _yaml(checked, known_sources)


def _yaml(checked: Checked, known_sources: Mapping[str, ErrorSource]) -> None:
    kind, reader = OTHERS.get(checked.path.suffix.lower(), ("", ""))
    if kind:
        what = f"this is {kind}, which `check` does not read"
        checked.problems.append(Problem.of(checked.path, what, f"use `{reader}`"))
        return
    document = load_yaml(checked.path, checked.problems)
    if document is None:
        return
    given = document.data.get("format") if isinstance(document.data, dict) else None
    name = str(given).partition("/")[0]
    if name == "dbb-session":
        checked.kind = str(given)
        _session(checked)
        return
    for _, read, in_words in (one for one in _FORMATS if format_of(one[0]).partition("/")[0] == name):
        checked.kind = str(given)
        known = (known_sources,) if name == "dbb-model" else ()
        found = read(checked.path, *known, checked.problems)
        checked.summary = "" if found is None else in_words(found)
        return
    what = "the file does not say what format it has" if given is None else f"`{given}` is no format"
    formats = ", ".join((*SCHEMAS, "dbb-instrument/1"))
    checked.problems.append(document.problem(("format",), what, f"begin it with `format: `, one of {formats}"))


def _model(model: IdentifiedModel) -> str:
    names = sorted({one.source.name for one in model.model.of_the_machine().sources})
    return f"model of {model.model.machine.name}: {', '.join(names) or 'no sources'}"


def _job(job: JobFile) -> str:
    left, limits = ", ".join(job.may_change) or "nothing", _count(len(job.tolerances), "tolerance")
    return f"job {job.name}: {limits}, {left} left to the operator"


def _bar(bar: BarFile) -> str:
    long_um, u_um = 1e3 * (bar.readings.mean_mm - bar.length_mm), 1e3 * bar.uncertainty_mm
    return f"bar {bar.serial_number}: reads {long_um:+.2f} µm long, standard uncertainty {u_um:.2f} µm"


def _simulator(found: SimulatorFile) -> str:
    ports, parameters = _count(len(found.ports), "port"), _count(len(found.parameters), "parameter")
    return f"simulator {found.name}: {parameters}, {ports}, {_count(len(found.outputs), 'output')}"


_FORMATS: tuple[tuple[type[Schema | Record], Callable[..., Any], Callable[[Any], str]], ...] = (
    (BarFile, parse_bar, _bar),
    (
        JigFile,
        parse_jig,
        lambda one: f"jig with {_count(len(one.jig.bores), 'bore')}, {_count(len(one.balls), 'ball')}",
    ),
    (JobFile, parse_job, _job),
    (MachineFile, parse_machine, lambda machine: f"machine {machine.name}"),
    (MappingFile, parse_mapping, lambda mapping: f"mapping of {_count(len(mapping.columns), 'column')}"),
    (ModelFile, parse_model, _model),
    (PlanFile, parse_plan, lambda one: f"plan {one.name}: {_count(len(one.tests), 'test')}"),
    (
        SettingsFile,
        lambda path, _faults: read_settings([path]),
        lambda one: f"settings: {_count(len(one.values) + len(one.tolerances), 'value')}",
    ),
    (SimulatorFile, parse_simulator, _simulator),
)
"""Schema of each format but sessions, how it is read, with its faults, and told in one line. A model also needs the error
sources."""

SCHEMAS = {format_of(schema): schema for schema in sorted((SessionFile, *(one for one, *_ in _FORMATS)), key=format_of)}
"""Schema of each format, by name with version."""


def _run(checked: Checked) -> None:
    run = read_run(checked.path)
    checked.warnings += run.warnings
    if checked.path.suffix != PART:  # the good lines of a run that died are what they are
        checked.problems += _implausible(checked.path, run.recording)
    seconds = run.recording.t_s[-1] - run.recording.t_s[0]
    lost = lost_samples(run.recording.t_s)
    unused = len(run.recording) - len(run.recording.good)
    told = (f", {lost} lost" if lost else "") + (f", {unused} doubtful or no length" if unused else "")
    checked.summary = f"run: {_count(len(run.recording), 'sample')} in {seconds:.1f} s{told}"


def _implausible(path: Path, recording: Recording) -> list[Problem]:
    faults = Faults(path)
    usable = np.arange(len(recording)) if recording.usable is None else np.flatnonzero(recording.usable)
    if len(usable) < FEWEST_SAMPLES:
        what = f"{_count(len(usable), 'usable sample')}: a circle takes {FEWEST_SAMPLES} at the least"
        faults.add(what, "check that it is the whole recording, and what `status` says")
    lengths = recording.length_mm[usable]
    wrong = np.flatnonzero((lengths < BAR_LENGTH.least) | (lengths > BAR_LENGTH.most))
    if wrong.size:
        found = float(lengths[wrong[0]])
        what = f"length_mm is {found:g} in sample {usable[wrong[0]] + 1}, expected {BAR_LENGTH.range}{BAR_LENGTH.guess(found)}"
        more = f"; {wrong.size - 1} more are so" if wrong.size > 1 else ""
        faults.add(what + more, "give the whole distance between the balls in mm, nothing taken off")
    return faults


def _drive(checked: Checked) -> None:
    drive = read_drive(checked.path)
    checked.warnings += drive.warnings
    t = drive.numbers["t_s"]
    checked.summary = f"drive: {_count(len(t), 'sample')} in {t[-1] - t[0]:.1f} s"


def _session(checked: Checked) -> None:
    session = parse_session(checked.path, checked.problems)
    if session is None or checked.problems:
        return
    wanted: list[tuple[RunEntry, Recording]] = []
    checked.warnings += [
        Problem.of(run.path, f"samples: {run.counts.text}")
        for run in session.runs
        if run.counts is not None and (run.counts.lost or run.counts.rejected)
    ]
    for run in session.runs:
        try:
            read = session.load(run)
            if run.state in JUDGED:
                wanted.append((run, read.recording))
            checked.warnings += read.warnings
            if run.state is not RunState.REJECTED:
                checked.warnings += session.loss(run, read.recording)
        except InputError as error:
            # A run that died before its first sample is no fault of the session.
            found = checked.warnings if run.state is RunState.RECORDING else checked.problems
            found += error.problems
    for path in unlisted_sealed(session):
        what = "this sealed run is in no list: the session does not use it"
        remedy = "`dbbstation session take-in` lists it, to be accepted or rejected"
        checked.warnings.append(Problem.of(path, what, remedy))
    try:
        session.plan.check(session.machine)
    except TravelError as error:
        checked.problems.append(Problem.of(session.plan_path, f"{error.where}: {error.what}", error.remedy))
    _judge(checked, session, wanted)
    _amended(checked, session)
    checked.summary = f"session: {_states(session)}; {_seal(session)}"
    checked.virtual = session.virtual
    if session.virtual:
        open_book().note_virtual(session.name)


def _amended(checked: Checked, session: SessionFolder) -> None:
    checked.warnings += [Problem.of(session.folder, amendment.text) for amendment in session.amendments]
    log = read_event_log(session.folder, [])
    if log is not None:
        checked.warnings += few([Problem.of(log.path, what) for what in set_back(log)])
    if session.seal is not None:
        checked.problems += copy_faults(session.folder, session.seal, session.amendments)


def _seal(session: SessionFolder) -> str:
    if session.seal is None:
        return NO_SEAL
    return f"sealed, {_count(session.seal.log.events if session.seal.log else 0, 'event')}, anchor {anchor_of(session.seal)[:SHORTEST]}"


NO_SEAL = "it carries no seal (`dbbstation session seal` writes one)"
"""Note on sessions that were written by hand: a changed plan is undetected."""


def _judge(checked: Checked, session: SessionFolder, wanted: Sequence[tuple[RunEntry, Recording]]) -> None:
    checked.judgements = judge_session(session, wanted)
    for (run, _), judgement in zip(wanted, checked.judgements, strict=True):
        lossy = any(finding.name is Name.LOST for finding in judgement.wrong)
        said = {Name.LOST, Name.CIRCLE} if lossy else {Name.LOST}
        checked.warnings += [
            Problem.of(run.path, f"{finding.name}: {finding.text}")
            for finding in judgement.wrong
            if finding.name not in said
        ]


def _states(session: SessionFolder) -> str:
    counts = {state: len(session.in_state(state)) for state in RunState}
    told = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    return f"{_count(len(session.runs), 'run')} ({told})" if told else "no runs yet"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
