"""Update a session folder while runs are recorded and judged."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Self

from dbbstation.errors import InputError, OutputError
from dbbstation.files.atomic import remove_leftovers, write_bytes
from dbbstation.files.formats.session import CommandedProgram, LogMark, Note, RunEntry, RunState, SessionDetails
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.places import PROGRAMS, RUNS, SESSION_FILE
from dbbstation.files.recordings.event_log import EVENTS_FILE
from dbbstation.files.recordings.journal import RunWriter, run_name
from dbbstation.files.recordings.lock import SessionLock
from dbbstation.files.recordings.new_session import write_session
from dbbstation.files.recordings.run_csv import sha256_of
from dbbstation.files.recordings.seal import chained, hashes, keep_copies, sealed_names, sealed_over
from dbbstation.files.recordings.session import no_session, part_entry, read_session
from dbbstation.files.recordings.session_checks import readings_in
from dbbstation.files.recordings.session_state import session_data
from dbbstation.files.recordings.session_store import SessionStore, now
from dbbstation.system.handles import Closing

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from datetime import datetime
    from pathlib import Path

    from dbbstation.files.formats.plan import PlanFile
    from dbbstation.files.formats.session import Counts, ReadBy
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Direction


class SessionWriter(Closing):
    """Writes one session folder while runs are recorded.

    Every step survives a crash: a run's `.part` exists before the session file names it, and is sealed before it is complete.
    """

    def __init__(self, folder: Path, lock: SessionLock, clock: Callable[[], datetime]) -> None:
        self._lock = lock
        self._store = SessionStore(folder, clock)
        self._clock = clock
        self.session = self._kept = replace(read_session(folder), sha256=self._store.sha256)

    def close(self) -> None:
        """Unlock the session for others; may be called twice."""
        self._lock.close()

    @classmethod
    def create(
        cls,
        folder: Path,
        machine: Machine,
        plan: PlanFile,
        details: SessionDetails | None = None,
        clock: Callable[[], datetime] = now,
    ) -> Self:
        """Make a session folder with machine and plan and no runs.

        Raises:
            InputError: a value that a session must not contain.
            OutputError: the folder exists, lies in another session, or cannot be written.
        """
        write_session(folder, machine, plan, (), details, at=clock())
        return cls._locked(folder, 0.0, clock)

    @classmethod
    def _locked(cls, folder: Path, patience_s: float, clock: Callable[[], datetime]) -> Self:
        lock = SessionLock(folder, patience_s)
        try:
            writer = cls(folder, lock, clock)
            writer._take_over()
        except BaseException:
            lock.close()
            raise
        return writer

    @classmethod
    def open(cls, folder: Path, patience_s: float = 0.0, clock: Callable[[], datetime] = now) -> Self:
        """Continue a session; interrupted runs are kept and listed as `recording`.

        Raises:
            InputError: every fault of the session.
            OutputError: another process writes into it, or it cannot be written.
        """
        if not any((folder / name).is_file() for name in (SESSION_FILE, EVENTS_FILE)):
            raise InputError([no_session(folder)])  # no lock is left in what is no session
        return cls._locked(folder, patience_s, clock)

    def _take_over(self) -> None:
        folder = self.session.folder
        remove_leftovers(folder)
        # A run that was sealed when the station died only lacks its hash.
        for run in self.runs:
            if run.state is RunState.RECORDING and run.path.suffix == ".csv" and run.path.is_file():
                digest = sha256_of(run.path)
                found = part_entry(run.path)
                counts = None if found is None else found.counts
                self._put(replace(run, state=RunState.COMPLETE, sha256=digest, counts=counts))
        self._write("taken over")

    @property
    def runs(self) -> tuple[RunEntry, ...]:
        """Return runs in starting order."""
        return self.session.runs

    def next_repeat(self, test: str, direction: Direction) -> int:
        """Return the repeat after every existing one."""
        taken = [run.repeat for run in self.runs if (run.test, run.direction) == (test, direction)]
        repeat = max(taken, default=0) + 1
        while any(self.session.folder.glob(f"{RUNS}/{run_name(test, direction, repeat)}*")):
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
        program: CommandedProgram | None = None,
        centre_mm: tuple[float, float, float] | None = None,
        instrument: ReadBy | None = None,
    ) -> RunWriter:
        """Start a test's next repeat: make its `.part` file and note it as `recording`.

        Args:
            started: first sample, with its zone.
            program: from `add_program`; None: the plan's circle.
            centre_mm: as programmed; None: as planned.
            instrument: None: not noted.

        Raises:
            InputError: the plan has no such run.
            OutputError: the disk refuses.
        """
        if (test, direction) not in self.session.plan.runs():
            what = f"the plan has no run {test} {direction}"
            raise InputError.of(self.session.plan_path, what, "choose a test of the plan")
        if self.session.seal is None:
            self._seal()
        repeat = self.next_repeat(test, direction)
        writer = RunWriter(self.session.folder / RUNS, test, direction, repeat, columns)
        entry = RunEntry(
            test=test,
            direction=direction,
            repeat=repeat,
            mounting=mounting,
            state=RunState.RECORDING,
            started=started,
            path=writer.path,
            program=program,
            centre_mm=centre_mm,
            instrument=instrument,
        )
        self._noted(entry, "run started")
        return writer

    def finish_run(self, writer: RunWriter, counts: Counts | None = None) -> RunEntry:
        """Seal a run and note it as `complete`.

        Args:
            counts: None: not known.

        Raises:
            OutputError: it has no sample, or the disk refuses; it stays `recording`.
        """
        entry = next(run for run in self.runs if run.path == writer.path)
        digest = writer.seal(counts)
        done = replace(entry, state=RunState.COMPLETE, path=writer.sealed_path, sha256=digest, counts=counts)
        return self._noted(done, "run sealed")

    def judge(self, run: RunEntry, *, accepted: bool, reason: str = "") -> RunEntry:
        """Note a sealed run as `accepted` or `rejected`.

        Args:
            reason: empty for an accepted usable run.

        Raises:
            OutputError: the run is not complete, or the disk refuses.
        """
        if run.state is RunState.RECORDING:
            raise OutputError("a run that is not complete cannot be judged", where=run.label, remedy="run it again")
        state = RunState.ACCEPTED if accepted else RunState.REJECTED
        return self._noted(replace(run, state=state, reason=reason), state.value)

    def note(self, note: Note) -> None:
        """Add a note.

        Raises:
            OutputError: the disk refuses.
        """
        self.session = replace(self.session, notes=(*self.session.notes, note))
        self._write("noted")

    def take_in(self, path: Path) -> RunEntry:
        """List an unlisted sealed run as `complete`, to be judged.

        Raises:
            InputError: it names no run of the plan, is damaged, or is listed already.
            OutputError: the disk refuses.
        """
        found, file = part_entry(path), str(path)
        if found is None or (found.test, found.direction) not in self.session.plan.runs():
            what = "the file does not say which run of this plan it is"
            raise InputError.of(file, what, "its first lines name test, direction and repeat", line=1)
        if any(run.key == found.key for run in self.runs):
            what = f"the session lists another run {found.label}"
            raise InputError.of(file, what, "give one of them another repeat", line=1)
        digest = sha256_of(path)
        entry = replace(found, state=RunState.COMPLETE, sha256=digest)
        self.session.load(entry)
        return self._noted(entry, "taken in")

    def add_program(self, name: str, content: bytes, *, model_sha256: str = "") -> CommandedProgram:
        """Keep an NC program; an equal one is reused.

        Raises:
            OutputError: another program has that name, or the disk refuses.
        """
        path = self.session.folder / PROGRAMS / name
        digest = sha256_hex(content)
        if not (path.is_file() and sha256_of(path) == digest):
            write_bytes(path, content, rewrites=True)
        return CommandedProgram(path, digest, model_sha256)

    def _seal(self) -> None:
        session = self.session
        found = hashes(session.folder, sealed_names(session.folder, session.names))
        keep_copies(session.folder, found)
        runs = chained(session.runs)
        self.session = replace(session, runs=runs, seal=sealed_over(found, runs))

    def _noted(self, entry: RunEntry, what: str) -> RunEntry:
        put = self._put(entry)
        self._write(what)
        return put

    def _put(self, entry: RunEntry) -> RunEntry:
        runs = tuple(({run.key: run for run in self.runs} | {entry.key: entry}).values())
        seal = self.session.seal
        if seal is not None:
            runs = chained(runs)
            seal = sealed_over(seal.files, runs)
        self.session = replace(self.session, runs=runs, seal=seal)
        return next(run for run in runs if run.key == entry.key)

    def _write(self, what: str) -> None:
        try:
            self._take_readings()
            session = self.session
            self._store.write(session_data(session.folder, session.names, session, session.runs), what)
        except BaseException:
            self.session = self._kept
            raise
        seal = session.seal
        if seal is not None:
            seal = replace(seal, log=LogMark(len(self._store.log.events), self._store.log.links[-1]))
        self.session = self._kept = replace(session, sha256=self._store.sha256, seal=seal)

    def _take_readings(self) -> None:
        other = self._store.changed_meanwhile()
        if other is not None:
            readings = readings_in(self.session.folder / SESSION_FILE, self.session.plan)
            self._store.accept_readings(other)
            self.session = replace(self.session, set_up_errors=readings)
        if self._store.put_aside is not None:
            where = f"; as it was: {self._store.put_aside}" if self._store.put_aside else ""
            text = f"the session file could not be read and was written anew{where}"
            self.session = replace(self.session, notes=(*self.session.notes, Note(self._clock(), text)))
            self._store.put_aside = None
