"""Making a session folder and keeping its session file true while runs come in."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Self

from dbbstation.errors import InputError, OutputError, Problem
from dbbstation.files.atomic import remove_leftovers, write_bytes, write_folder, write_text
from dbbstation.files.formats.machine import MachineFile, machine_data, machine_parts
from dbbstation.files.formats.plan import InlinePlan, plan_data
from dbbstation.files.formats.session import SessionFile
from dbbstation.files.recordings.journal import RunWriter, run_header, run_line, run_name
from dbbstation.files.recordings.lock import SessionLock
from dbbstation.files.recordings.session import (
    SESSION_FILE,
    Bar,
    Program,
    RunEntry,
    RunState,
    SessionFolder,
    part_entry,
    read_session,
)
from dbbstation.files.recordings.session_checks import check_bar
from dbbstation.files.recordings.session_set_up import readings_in
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import format_for, validate
from dbbstation.files.yaml.text import parse_yaml

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.files.recordings.session_set_up import SetUpReadings
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.circle import Direction

MACHINE_FILE, PLAN_FILE, RUNS, PROGRAMS = "machine.yaml", "plan.yaml", "runs", "programs"


@dataclass(frozen=True)
class SessionDetails:
    """What a session notes beside its runs; everything optional.

    Attributes:
        serial_number: of the machine.
        operator: who measures.
        ambient_temp_c: temperature of the shop [degC].
        bar: the bar.
        set_up_errors: micrometer readings of balls that were put up under the spindle.
    """

    serial_number: str = ""
    operator: str = ""
    ambient_temp_c: float | None = None
    bar: Bar | None = None
    set_up_errors: tuple[SetUpReadings, ...] = ()


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A run that exists whole, such as a simulated one.

    Attributes:
        test: name of the test.
        direction: sense of travel.
        columns: by name, each of shape (n,), in the columns' units.
        repeat: of this test and direction.
        mounting: counts how often a ball was put up; None: one mounting per test.
        started: when the first sample was taken; None where that means nothing.
        program: name and bytes of the NC program that was commanded, None for the plan's circle.
        model_sha256: of the model that the program was compensated with.
    """

    test: str
    direction: Direction
    columns: Mapping[str, NDArray[np.float64]]
    repeat: int = 1
    mounting: int | None = None
    started: datetime | None = None
    program: tuple[str, bytes] | None = None
    model_sha256: str = ""


def write_session(
    folder: Path,
    machine: Machine,
    plan: InlinePlan,
    runs: Sequence[FinishedRun],
    details: SessionDetails | None = None,
) -> None:
    """Write a whole session at once, every run accepted; all of it or nothing.

    Raises:
        OutputError: the folder exists already, or cannot be written.
    """
    files: dict[str, str | bytes] = {}
    entries = []
    for run in runs:
        name = f"{RUNS}/{run_name(run.test, run.direction, run.repeat)}"
        files[name] = data = _run_bytes(run)
        program = None
        if run.program is not None:
            path = f"{PROGRAMS}/{run.program[0]}"
            files[path] = run.program[1]
            program = Program(folder / path, hashlib.sha256(run.program[1]).hexdigest(), run.model_sha256)
        entry = RunEntry(
            test=run.test,
            direction=run.direction,
            repeat=run.repeat,
            mounting=run.mounting,
            state=RunState.ACCEPTED,
            reason="",
            started=run.started,
            path=folder / name,
            sha256=hashlib.sha256(data).hexdigest(),
            program=program,
            centre_mm=None,
        )
        entries.append(entry)
    _make_folder(folder, machine, plan, details or SessionDetails(), entries, files)


def _make_folder(
    folder: Path,
    machine: Machine,
    plan: InlinePlan,
    details: SessionDetails,
    entries: Sequence[RunEntry],
    files: Mapping[str, str | bytes],
) -> None:
    if folder.exists():
        raise OutputError("the session folder exists already", where=str(folder), remedy="choose another name")
    whole: dict[str, str | bytes] = {f"{RUNS}/": "", f"{PROGRAMS}/": "", **files}
    nominal = machine_data(machine_parts(machine))
    whole[MACHINE_FILE] = yaml_text({"format": format_for(MachineFile, nominal), **nominal})
    whole[PLAN_FILE] = yaml_text(plan_data(plan))
    names = (folder / MACHINE_FILE, folder / PLAN_FILE)
    whole[SESSION_FILE] = text = _session_text(folder, names, details, entries)
    _check_details(text, folder, plan)
    write_folder(folder, whole)


def _check_details(text: str, folder: Path, plan: InlinePlan) -> None:
    """Hold what a session notes against its format and plan before anything is written.

    Raises:
        InputError: everything that no session may say, such as a bar's length in metres.
    """
    faults: list[Problem] = []
    document = parse_yaml(text, str(folder / SESSION_FILE), faults)
    session = None if document is None else validate(document, SessionFile, faults)
    if document is not None and session is not None and session.bar is not None:
        check_bar(document, session.bar.calibrated_length_mm, session.bar.stroke_mm, plan.to_domain(), faults)
    if faults:
        raise InputError([replace(fault, file=str(folder), line=0, column=0) for fault in faults])


class SessionWriter:
    """Keeps one session folder while runs are recorded.

    The order of writing makes every moment survivable: the `.part` exists before the session file names it, and is
    sealed before the session file calls it complete. Micrometer readings that a person saves in the session file meanwhile
    are taken over; where they are wrong, the next step raises InputError and leaves the file as it is.
    """

    def __init__(self, session: SessionFolder, lock: SessionLock) -> None:
        self._session, self._lock = session, lock

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let others write into the session."""
        self.close()

    def close(self) -> None:
        """Let others write into the session; may be called twice."""
        self._lock.close()

    @property
    def locked(self) -> bool:
        """Whether no other process can write into the session; False on a file system that knows no locks."""
        return self._lock.held

    @classmethod
    def create(
        cls, folder: Path, machine: Machine, plan: InlinePlan, details: SessionDetails | None = None
    ) -> SessionWriter:
        """Make a session folder with machine and plan in it and no runs.

        Raises:
            OutputError: the folder exists already, or cannot be written.
        """
        _make_folder(folder, machine, plan, details or SessionDetails(), (), {})
        return cls(read_session(folder), SessionLock(folder))

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Go on with a session: half-recorded runs are kept and listed as `recording`.

        Raises:
            InputError: every fault of the session.
            OutputError: another process writes into it, or the session file cannot be written.
        """
        read_session(folder)  # no lock is left in what is no session
        writer = cls(read_session(folder), SessionLock(folder))
        for inner in (folder, folder / RUNS, folder / PROGRAMS):
            remove_leftovers(inner)
        # A run that was sealed when the station died only lacks its hash.
        for run in writer.runs:
            if run.state is RunState.RECORDING and run.path.suffix == ".csv":
                digest = hashlib.sha256(run.path.read_bytes()).hexdigest()
                writer._put(replace(run, state=RunState.COMPLETE, sha256=digest))
        writer._write()
        return writer

    @property
    def session(self) -> SessionFolder:
        """The session as it stands on disk."""
        return self._session

    @property
    def runs(self) -> tuple[RunEntry, ...]:
        """Runs in the order they were started."""
        return self._session.runs

    def next_repeat(self, test: str, direction: Direction) -> int:
        """Return the first repeat of a test and direction after every one that exists."""
        taken = [run.repeat for run in self.runs if (run.test, run.direction) == (test, direction)]
        repeat = max(taken, default=0) + 1
        while any(self._session.folder.glob(f"{RUNS}/{run_name(test, direction, repeat)}*")):
            repeat += 1
        return repeat

    def start_run(
        self,
        test: str,
        direction: Direction,
        columns: Sequence[str],
        *,
        started: datetime,
        mounting: int | None = None,
        program: Program | None = None,
        centre_mm: tuple[float, float, float] | None = None,
    ) -> RunWriter:
        """Start the next repeat of a test: its `.part` is made and noted as `recording`.

        Args:
            test: name of the test in the plan.
            direction: sense of travel.
            columns: as `RunWriter` takes them.
            started: time of the first sample, with its zone.
            mounting: counts how often the ball was put up.
            program: from `add_program`, where the plan's circle is not what is commanded.
            centre_mm: centre of the circle as programmed where it differs from the plan [mm].

        Raises:
            InputError: the plan has no such run.
            OutputError: the disk refuses.
        """
        if test not in self._session.plan.tests or direction not in self._session.plan.tests[test].directions:
            what = f"the plan has no run {test} {direction}"
            raise InputError([Problem(str(self._session.plan_path), 0, 0, what, "choose a test of the plan")])
        repeat = self.next_repeat(test, direction)
        writer = RunWriter(self._session.folder / RUNS, test, direction, repeat, columns)
        entry = RunEntry(
            test=test,
            direction=direction,
            repeat=repeat,
            mounting=mounting,
            state=RunState.RECORDING,
            reason="",
            started=started,
            path=writer.path,
            sha256="",
            program=program,
            centre_mm=centre_mm,
        )
        self._put(entry)
        self._write()
        return writer

    def finish_run(self, writer: RunWriter) -> RunEntry:
        """Seal a run and note it as `complete`.

        Raises:
            OutputError: it has no sample, or the disk refuses; it stays `recording` then.
        """
        entry = next(run for run in self.runs if run.path == writer.path)
        digest = writer.seal()
        done = replace(entry, state=RunState.COMPLETE, path=writer.sealed_path, sha256=digest)
        self._put(done)
        self._write()
        return done

    def judge(self, run: RunEntry, *, accepted: bool, reason: str = "") -> RunEntry:
        """Note a sealed run as `accepted` or `rejected`.

        Raises:
            OutputError: the run is not complete, or the disk refuses.
        """
        if run.state is RunState.RECORDING:
            raise OutputError("a run that is not complete cannot be judged", where=run.label, remedy="run it again")
        state = RunState.ACCEPTED if accepted else RunState.REJECTED
        judged = replace(run, state=state, reason="" if accepted else reason)
        self._put(judged)
        self._write()
        return judged

    def take_in(self, path: Path) -> RunEntry:
        """List a sealed run that lies in the folder and is in no list, as `complete`: it is still to be judged.

        Raises:
            InputError: it does not say which run of the plan it is, is damaged, or that run is listed already.
            OutputError: the disk refuses.
        """
        found, file = part_entry(path), str(path)
        if found is None or (found.test, found.direction) not in {
            (name, direction) for name, test in self._session.plan.tests.items() for direction in test.directions
        }:
            what = "the file does not say which run of this plan it is"
            raise InputError([Problem(file, 1, 0, what, "its first lines name test, direction and repeat")])
        if any(
            (run.test, run.direction, run.repeat) == (found.test, found.direction, found.repeat) for run in self.runs
        ):
            what = f"the session lists another run {found.label}"
            raise InputError([Problem(file, 1, 0, what, "give one of them another repeat")])
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        entry = replace(found, state=RunState.COMPLETE, sha256=digest)
        self._session.load(entry)
        self._put(entry)
        self._write()
        return entry

    def add_program(self, name: str, content: bytes, *, model_sha256: str = "") -> Program:
        """Keep an NC program in the session; one of the same name and content is taken as it is.

        Raises:
            OutputError: another program has that name, or the disk refuses.
        """
        path = self._session.folder / PROGRAMS / name
        if not (path.is_file() and path.read_bytes() == content):
            write_bytes(path, content)
        return Program(path, hashlib.sha256(content).hexdigest(), model_sha256)

    def _put(self, entry: RunEntry) -> None:
        key = (entry.test, entry.direction, entry.repeat)
        runs = {(run.test, run.direction, run.repeat): run for run in self.runs} | {key: entry}
        self._session = replace(self._session, runs=tuple(runs.values()))

    def _write(self) -> None:
        file, session = self._session.folder / SESSION_FILE, self._session
        if file.is_file() and hashlib.sha256(file.read_bytes()).hexdigest() != session.sha256:
            # Somebody wrote micrometer readings into it while runs come in; nothing else may be changed there.
            session = replace(session, set_up_errors=readings_in(file, session.plan))
        details = SessionDetails(**{each.name: getattr(session, each.name) for each in fields(SessionDetails)})
        names = (session.machine_path, session.plan_path)
        text = _session_text(session.folder, names, details, session.runs)
        write_text(file, text, force=True, rewrites=True)
        self._session = replace(session, sha256=hashlib.sha256(text.encode()).hexdigest())


def _session_text(folder: Path, names: tuple[Path, Path], details: SessionDetails, runs: Sequence[RunEntry]) -> str:
    bar = details.bar
    data: dict[str, object] = {
        "format": "",
        "machine": names[0].relative_to(folder).as_posix(),
        "plan": names[1].relative_to(folder).as_posix(),
        "serial_number": details.serial_number,
        "operator": details.operator,
        "ambient_temp_c": details.ambient_temp_c,
        "bar": bar and {each.name: _plain(getattr(bar, each.name)) for each in fields(bar)},
        "set_up_errors": [_without_none(asdict(readings)) for readings in details.set_up_errors] or None,
    }
    data = {key: _without_none(value) for key, value in data.items() if value is not None}
    data["format"] = format_for(SessionFile, data)
    return yaml_text({**data, "runs": [_without_none(_run_data(folder, run)) for run in runs]})


def _run_data(folder: Path, run: RunEntry) -> dict[str, object]:
    program = run.program and {
        "file": run.program.path.relative_to(folder).as_posix(),
        "sha256": run.program.sha256,
        "model_sha256": run.program.model_sha256 or None,
    }
    return {
        "test": run.test,
        "direction": run.direction.value,
        "repeat": run.repeat,
        "mounting": run.mounting,
        "file": run.path.relative_to(folder).as_posix(),
        "started": _plain(run.started),
        "state": run.state.value,
        "reason": run.reason or None,
        "sha256": run.sha256 or None,
        "centre_mm": run.centre_mm,
        "program": _without_none(program),
    }


def _without_none(value: object) -> object:
    return {key: item for key, item in value.items() if item is not None} if isinstance(value, dict) else value


def _plain(value: object) -> object:
    if not isinstance(value, datetime):
        return value
    return value.astimezone(UTC).isoformat().replace("+00:00", "Z")


def _run_bytes(run: FinishedRun) -> bytes:
    names = tuple(run.columns)
    rows = zip(*(values.tolist() for values in run.columns.values()), strict=True)
    header = run_header(run.test, run.direction, run.repeat, names)
    return header + b"".join([run_line(row, names) for row in rows])
