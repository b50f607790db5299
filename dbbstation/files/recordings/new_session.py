"""Make a session folder: empty for recording, or complete, such as a simulation's."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, OutputError, Problem
from dbbstation.facts import NamedRun, of_facts
from dbbstation.files.atomic import write_folder
from dbbstation.files.formats.machine import machine_text
from dbbstation.files.formats.plan import plan_text
from dbbstation.files.formats.session import CommandedProgram, RunEntry, RunState, SessionDetails, SessionFile
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.places import MACHINE_FILE, PLAN_FILE, PROGRAMS, RUNS, SESSION_FILE, refuse_recorded
from dbbstation.files.recordings.event_log import EVENTS_FILE
from dbbstation.files.recordings.journal import run_header, run_line, run_name
from dbbstation.files.recordings.seal import chained, copy_name, is_copy, sealed_over
from dbbstation.files.recordings.session_checks import check_bar
from dbbstation.files.recordings.session_state import session_data, text_of
from dbbstation.files.recordings.session_store import first_log
from dbbstation.files.yaml.schema import validate
from dbbstation.files.yaml.text import parse_yaml

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Direction


@dataclass(frozen=True, eq=False)
class FinishedRun(NamedRun):
    """A complete run, such as a simulated one.

    Attributes:
        columns: by name, each of shape (n,), in the columns' units.
        mounting: number of the ball's set-up; None: one per test.
        started: time of the first sample; None for a computed run.
        program: name and bytes of the NC program; None for the plan's circle.
        reason: of a rejection; else empty.
        texts: text columns such as `status`, n each.
        exact: write as many digits as read back the same bits.
    """

    test: str
    direction: Direction
    columns: Mapping[str, Floats]
    repeat: int = 1
    mounting: int | None = None
    started: datetime | None = None
    program: tuple[str, bytes] | None = None
    model_sha256: str = ""
    state: RunState = RunState.ACCEPTED
    reason: str = ""
    texts: Mapping[str, Sequence[str]] = field(default_factory=dict)
    exact: bool = False


def write_session(
    folder: Path,
    machine: Machine,
    plan: PlanFile,
    runs: Sequence[FinishedRun],
    details: SessionDetails | None = None,
    more: Mapping[str, str | bytes] | None = None,
    at: datetime | None = None,
) -> None:
    """Make a sealed session folder with its event log, completely or not at all.

    Args:
        more: content by relative path, besides runs, machine, plan and session file.
        at: for the log; None for a computed session, which then always has the same bytes.

    Raises:
        InputError: a value that a session must not contain.
        OutputError: the folder exists, lies in another session, or cannot be written.
    """
    refuse_recorded(folder)
    if folder.exists():
        raise OutputError("the session folder exists already", where=str(folder), remedy="choose another name")
    files: dict[str, str | bytes] = {f"{RUNS}/": "", f"{PROGRAMS}/": "", **(more or {})}
    entries = []
    for run in runs:
        name = f"{RUNS}/{run_name(run.test, run.direction, run.repeat)}"
        files[name] = data = _run_bytes(run)
        program = None
        if run.program is not None:
            path = f"{PROGRAMS}/{run.program[0]}"
            files[path] = run.program[1]
            program = CommandedProgram(folder / path, sha256_hex(run.program[1]), run.model_sha256)
        digest = sha256_hex(data)
        entries.append(of_facts(RunEntry, run, path=folder / name, sha256=digest, program=program))
    files[MACHINE_FILE], files[PLAN_FILE] = machine_text(machine), plan_text(plan)
    sealed = {name: str(files[name]).encode() for name in (MACHINE_FILE, PLAN_FILE)}
    now = {name: sha256_hex(content) for name, content in sealed.items()}
    files |= {copy_name(name, now[name]): content for name, content in sealed.items()}
    chain = chained(entries)
    noted = replace(details or SessionDetails(), seal=sealed_over(now, chain))
    said = session_data(folder, (MACHINE_FILE, PLAN_FILE), noted, chain)
    _check_details(text_of(said), folder, plan)
    files[EVENTS_FILE], marked = first_log(said, at)
    files[SESSION_FILE] = text_of(marked)
    write_folder(folder, files, read_only=lambda name: is_copy(name) or name.startswith(f"{RUNS}/"))


def _check_details(text: str, folder: Path, plan: PlanFile) -> None:
    faults: list[Problem] = []
    document = parse_yaml(text, str(folder / SESSION_FILE), faults)
    session = None if document is None else validate(document, SessionFile, folder)
    if document is not None and session is not None:
        check_bar(document, session.bar, plan.to_domain())
    if faults:
        raise InputError([replace(fault, file=str(folder), line=0, column=0) for fault in faults])


def _run_bytes(run: FinishedRun) -> bytes:
    names = (*run.columns, *run.texts)
    rows = zip(*(values.tolist() for values in run.columns.values()), *run.texts.values(), strict=True)
    header = run_header(run.test, run.direction, run.repeat, names)
    return header + b"".join([run_line(row, names, exact=run.exact) for row in rows])
