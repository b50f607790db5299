"""Making a session folder and keeping its session file true while runs come in."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Self

from dbbstation.errors import InputError, OutputError, Problem
from dbbstation.files.atomic import remove_leftovers, write_bytes, write_folder, write_text
from dbbstation.files.formats.machine import machine_text
from dbbstation.files.formats.plan import plan_text
from dbbstation.files.formats.session import SessionFile
from dbbstation.files.gateway import content_of, digest_of
from dbbstation.files.recordings.entries import Program, RunEntry, RunState
from dbbstation.files.recordings.journal import RunWriter, run_header, run_line, run_name
from dbbstation.files.recordings.lock import SessionLock
from dbbstation.files.recordings.seal import chained, copy_name, hashes, keep_copies, sealed_names, sealed_over
from dbbstation.files.recordings.session import SESSION_FILE, SessionFolder, part_entry, read_session
from dbbstation.files.recordings.session_checks import check_bar
from dbbstation.files.recordings.session_details import SessionDetails
from dbbstation.files.recordings.session_set_up import readings_in
from dbbstation.files.recordings.session_text import session_text
from dbbstation.files.yaml.schema import validate
from dbbstation.files.yaml.text import parse_yaml

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from datetime import datetime
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.files.formats.plan import InlinePlan
    from dbbstation.files.recordings.entries import Counts, Note
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.circle import Direction

MACHINE_FILE, PLAN_FILE, RUNS, PROGRAMS = "machine.yaml", "plan.yaml", "runs", "programs"


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
        state: as the session notes it.
        reason: why it was rejected; empty otherwise.
        texts: columns that are no numbers, such as `status`, n texts each.
        exact: write as many digits as it takes to read back the same bits, not those that instruments resolve.
    """

    test: str
    direction: Direction
    columns: Mapping[str, NDArray[np.float64]]
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
    plan: InlinePlan,
    runs: Sequence[FinishedRun],
    details: SessionDetails | None = None,
    more: Mapping[str, str | bytes] | None = None,
) -> None:
    """Write a whole session at once; all of it or nothing.

    Args:
        folder: of the session.
        machine: nominal.
        plan: as run.
        runs: in order.
        details: what it notes beside them.
        more: further files by path in the folder.

    Raises:
        OutputError: the folder exists already, or cannot be written.
    """
    files: dict[str, str | bytes] = dict(more or {})
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
            state=run.state,
            reason=run.reason,
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
    whole[MACHINE_FILE], whole[PLAN_FILE] = machine_text(machine), plan_text(plan)
    sealed = {name: str(whole[name]).encode() for name in (MACHINE_FILE, PLAN_FILE)}
    now = {name: hashlib.sha256(content).hexdigest() for name, content in sealed.items()}
    whole |= {copy_name(name, now[name]): content for name, content in sealed.items()}
    runs = chained(entries)
    noted = replace(details, seal=sealed_over(now, runs))
    whole[SESSION_FILE] = text = session_text(folder, (MACHINE_FILE, PLAN_FILE), noted, runs)
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
                digest = digest_of(run.path)
                found = part_entry(run.path)
                counts = None if found is None else found.counts
                writer._put(replace(run, state=RunState.COMPLETE, sha256=digest, counts=counts))
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
        if self._session.seal is None:
            self._seal()
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

    def finish_run(self, writer: RunWriter, counts: Counts | None = None) -> RunEntry:
        """Seal a run and note it as `complete`.

        Args:
            writer: of its file.
            counts: what came over the line and what did not, where that is known.

        Raises:
            OutputError: it has no sample, or the disk refuses; it stays `recording` then.
        """
        entry = next(run for run in self.runs if run.path == writer.path)
        digest = writer.seal(counts)
        done = self._put(replace(entry, state=RunState.COMPLETE, path=writer.sealed_path, sha256=digest, counts=counts))
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
        judged = self._put(replace(run, state=state, reason="" if accepted else reason))
        self._write()
        return judged

    def note(self, note: Note) -> None:
        """Note something while it is measured.

        Raises:
            OutputError: the disk refuses.
        """
        self._session = replace(self._session, notes=(*self._session.notes, note))
        self._write()

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
        digest = digest_of(path)
        entry = replace(found, state=RunState.COMPLETE, sha256=digest)
        self._session.load(entry)
        taken = self._put(entry)
        self._write()
        return taken

    def add_program(self, name: str, content: bytes, *, model_sha256: str = "") -> Program:
        """Keep an NC program in the session; one of the same name and content is taken as it is.

        Raises:
            OutputError: another program has that name, or the disk refuses.
        """
        path = self._session.folder / PROGRAMS / name
        if not (path.is_file() and content_of(path) == content):
            write_bytes(path, content)
        return Program(path, hashlib.sha256(content).hexdigest(), model_sha256)

    def _seal(self) -> None:
        """Seal a session of an older program before more is recorded into it."""
        session = self._session
        found = hashes(session.folder, sealed_names(session.folder, session.names))
        keep_copies(session.folder, found)
        runs = chained(session.runs)
        self._session = replace(session, runs=runs, seal=sealed_over(found, runs))

    def _put(self, entry: RunEntry) -> RunEntry:
        """Put an entry into the list, at its place or at the end, and return it as it stands there."""
        key = (entry.test, entry.direction, entry.repeat)
        runs = tuple(({(run.test, run.direction, run.repeat): run for run in self.runs} | {key: entry}).values())
        seal = self._session.seal
        if seal is not None:
            runs = chained(runs)
            seal = sealed_over(seal.files, runs)
        self._session = replace(self._session, runs=runs, seal=seal)
        return next(run for run in runs if (run.test, run.direction, run.repeat) == key)

    def _write(self) -> None:
        file, session = self._session.folder / SESSION_FILE, self._session
        if file.is_file() and digest_of(file) != session.sha256:
            # Somebody wrote micrometer readings into it while runs come in; nothing else may be changed there.
            session = replace(session, set_up_errors=readings_in(file, session.plan))
        text = session_text(session.folder, session.names, session, session.runs)
        write_text(file, text, force=True, rewrites=True)
        self._session = replace(session, sha256=hashlib.sha256(text.encode()).hexdigest())


def _run_bytes(run: FinishedRun) -> bytes:
    names = (*run.columns, *run.texts)
    rows = zip(*(values.tolist() for values in run.columns.values()), *run.texts.values(), strict=True)
    header = run_header(run.test, run.direction, run.repeat, names)
    return header + b"".join([run_line(row, names, exact=run.exact) for row in rows])
