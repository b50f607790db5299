"""Read a session folder; runs are read on demand."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import Faults, InputError, Problem, TraceError, read_each, refuse
from dbbstation.facts.quantities import Quantity
from dbbstation.files.formats.machine import parse_machine
from dbbstation.files.formats.plan import parse_plan
from dbbstation.files.formats.session import PART, RunEntry, RunState, SessionDetails, SessionFile, starts_of
from dbbstation.files.gateway import digest_of
from dbbstation.files.inputs import open_book
from dbbstation.files.places import SESSION_FILE, name_of
from dbbstation.files.recordings.event_log import EVENTS_FILE
from dbbstation.files.recordings.run_csv import (
    RunFile,
    count_in,
    counts_in,
    read_run,
)
from dbbstation.files.recordings.run_lines import split_pieces
from dbbstation.files.recordings.seal import seal_faults
from dbbstation.files.recordings.session_checks import check_bar, check_runs, check_set_up_errors, mounted_name
from dbbstation.files.recordings.session_store import REBUILD, document_in_force, log_faults
from dbbstation.files.source_text import read_bytes, unreadable, without_faults
from dbbstation.files.yaml.schema import validate
from dbbstation.plan.bar import UNKNOWN_BAR_MM
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import Setup
from dbbstation.text.written import natural, repeats_in_order
from dbbstation.trace.cut import cut, lost_on_turn
from dbbstation.trace.recording import AFTER_LOSS, too_many_lost

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Circle, Plan
    from dbbstation.trace.recording import Recording

_UNLIKE_RADIUS = 0.2
"""Largest relative difference of readings from the bar's length; no ball bar has such a travel."""

_SLOWEST, _FASTEST = 50.0, 0.05
"""Plausible durations of a recording, relative to the circle's nominal duration."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SessionFolder(SessionDetails):
    """A session with machine, plan and notes; runs are read on demand.

    Attributes:
        machine: nominal, as the controller had it.
        runs: in starting order, of every state.
        keeps: recordings stay in memory, for a command that needs them repeatedly.
    """

    name: str
    folder: Path
    machine: Machine
    plan: Plan
    machine_path: Path
    plan_path: Path
    runs: tuple[RunEntry, ...]
    sha256: str
    keeps: bool = False

    @property
    def names(self) -> tuple[str, str]:
        """Return the relative paths of machine and plan, with forward slashes."""
        paths = (self.machine_path, self.plan_path)
        return tuple(path.relative_to(self.folder).as_posix() for path in paths)  # type: ignore[return-value]  # two of them

    @property
    def virtual(self) -> bool | None:
        """Return whether the session's runs come from a virtual machine; None if unknown."""
        stated = [one.virtual for one in (self.instrument, *(run.instrument for run in self.runs)) if one is not None]
        return any(stated) if stated else None

    def in_state(self, *states: RunState) -> tuple[RunEntry, ...]:
        """Return the runs in these states, with repeats in numerical order."""
        return repeats_in_order(run for run in self.runs if run.state in states)

    @property
    def accepted(self) -> tuple[RunEntry, ...]:
        """Return the accepted runs, as `in_state`."""
        return self.in_state(RunState.ACCEPTED)

    def circle(self, run: RunEntry) -> Circle:
        """Return a run's commanded circle, with its programmed centre."""
        circle = self.plan.tests[run.test].run(run.direction)
        return circle if run.centre_mm is None else replace(circle, centre_mm=run.centre_mm)

    def bar_temp_c(self, logged: Mapping[str, Floats]) -> float | None:
        """Return the bar's temperature by its thermometer, else the shop's; None if unknown."""
        return float(np.mean(logged["bar"])) if "bar" in logged else self.ambient_temp_c

    def setup(self, run: RunEntry, logged: Mapping[str, Floats] = MappingProxyType({})) -> Setup:
        """Return ball, mounting and bar of a run under names unique among sessions."""
        ball = self.plan.tests[run.test].ball
        mounted = mounted_name(self.plan, run.test, run.mounting)
        long_mm, uncertainty_mm = (
            (0.0, UNKNOWN_BAR_MM) if self.bar is None else self.bar.reads_long_mm(self.bar_temp_c(logged))
        )
        readings = (r for r in self.set_up_errors if mounted_name(self.plan, r.test, r.mounting) == mounted)
        setup = Setup.on(
            replace(ball, name=f"{self.name}: {ball.name}"),
            session=self.name,
            mounting=f"{self.name}: {mounted}",
            instrument=f"{self.name}: bar" if self.bar is None else self.bar.serial_number or f"{self.name}: bar",
            bar_uncertainty_mm=uncertainty_mm,
        )
        return replace(
            setup,
            bar_reads_long_mm=long_mm,
            bar_length_mm=None if self.bar is None else self.bar.calibrated_length_mm,
            set_up_errors=next((reading.to_domain() for reading in readings), None),
            moving_s=self.moving_s,
        )

    def started_s(self, run: RunEntry) -> float | None:
        """Return a run's start after the first one's [s]; None if not noted."""
        moments = starts_of(self.runs)
        return None if run.started is None else (run.started - min(moments)).total_seconds()

    @cached_property
    def moving_s(self) -> tuple[tuple[float, float], ...]:
        """Return begin and end of every run with a noted start, on the clock of `started_s` [s].

        A run ends with its circle at the plan's feed.
        """
        circles = [(began, self.circle(run)) for run in self.runs if (began := self.started_s(run)) is not None]
        return tuple(sorted((began, began + circle.swept_s) for began, circle in circles))

    def load(self, run: RunEntry) -> RunFile:
        """Read a run and check it against session and plan.

        Raises:
            InputError: the file was changed, is damaged, or holds another run.
        """
        if run.path in self._read:
            return self._read[run.path]
        read = read_run(run.path, sha256=run.sha256)
        faults = [*_header_faults(run, read.header), *self._implausible(run, read.recording)]
        refuse(faults)
        if self.keeps:
            self._read[run.path] = read
        return read

    @cached_property
    def _read(self) -> dict[Path, RunFile]:
        return {}

    def load_all(self, runs: Sequence[RunEntry]) -> list[RunFile]:
        """Read several runs.

        Raises:
            InputError: every fault of all files.
        """
        return read_each(self.load, runs)

    def loss(self, run: RunEntry, recording: Recording) -> list[Problem]:
        """Return a note if more samples were lost than the plan allows."""
        lost, kept, unusable = lost_on_turn(recording, self.circle(run))
        what = too_many_lost(lost, kept, self.plan.largest_loss_percent, unusable)
        return [Problem.of(run.path, what, AFTER_LOSS)] if what else []

    def unusable(self, run: RunEntry) -> str:
        """Return why a run's file gives no figures; empty if it gives figures."""
        try:
            recording = self.load(run).recording
            if lost := self.loss(run, recording):
                return lost[0].what
            cut(recording, self.circle(run))
        except InputError as error:
            return error.problems[0].what
        except TraceError as error:
            return str(error)
        return ""

    def _implausible(self, run: RunEntry, recording: Recording) -> list[Problem]:
        circle, faults = self.circle(run), Faults(run.path)
        bar = circle.bar_mm
        length = float(np.median(recording.length_mm))
        likely = Quantity("mm", (1.0 - _UNLIKE_RADIUS) * bar, (1.0 + _UNLIKE_RADIUS) * bar)
        if not likely.fits(length):
            what = f"length_mm is about {length:g}, the plan's test {run.test} has a bar of {bar:g} mm"
            guess = likely.guess(length)
            if not guess and abs(length) < _UNLIKE_RADIUS * bar:
                guess = " (it looks like a deviation from the radius)"
            remedy = "give the whole distance between the balls in mm, nothing taken off"
            faults.add(what + guess, remedy)
        if run.state is RunState.RECORDING:
            return faults
        expected = 360.0 / circle.turning_deg_s
        duration = float(recording.t_s[-1] - recording.t_s[0])
        if not _FASTEST * expected < duration < _SLOWEST * expected:
            what = f"t_s spans {duration:g}, a turn takes {expected:.1f} s at the plan's feed"
            faults.add(what, "give t_s in seconds, and the feed that was programmed")
        if recording.theta_deg is not None and np.ptp(recording.theta_deg) < np.pi * 2.0 + 0.1:
            what = f"theta_deg spans {np.ptp(recording.theta_deg):.3f} only (it looks like rad)"
            faults.add(what, "give a full turn in degrees")
        return faults


def read_session(path: Path, *, keeps: bool = False) -> SessionFolder:
    """Read a session from its folder or session file.

    The hashes of all files are checked here, those of runs when they are loaded.

    Raises:
        InputError: every fault of session, machine and plan, every missing or changed file.
    """
    session = without_faults(parse_session, path)
    if session.virtual:
        open_book().note_virtual(session.name)
    return replace(session, keeps=keeps)


def opened(session: Path | SessionFolder) -> SessionFolder:
    """Return a session, reading it if necessary; raises as `read_session`."""
    return session if isinstance(session, SessionFolder) else read_session(session)


def no_session(folder: Path) -> Problem:
    """Return the fault of a folder without a session, and name sessions nearby."""
    if (folder / EVENTS_FILE).is_file():
        what = f"the session file {SESSION_FILE} is gone, its event log is there"
        return Problem.of(folder, what, REBUILD.format(folder=folder))
    inside = sorted(file.parent for file in folder.glob(f"*/{SESSION_FILE}"))
    around = [folder.parent] if (folder.parent / SESSION_FILE).is_file() else []
    beside = sorted(file.parent for file in folder.parent.glob(f"*/{SESSION_FILE}"))
    near = ", ".join(str(session) for session in (inside or around or beside)[:MOST_NAMED])
    what = f"this folder is no session: there is no {SESSION_FILE} in it"
    return Problem.of(folder, what, f"did you mean {near}?" if near else "name a session folder")


def _other_than_session(path: Path) -> Problem | None:
    if path.is_dir():
        return None if (path / SESSION_FILE).exists() else no_session(path)
    if path.is_file() and path.suffix.lower() not in {".yaml", ".yml"}:  # such as the log beside them, by `shop/*`
        remedy = f"name session folders; `{path.parent}/*/` names all in that folder and no files"
        return Problem.of(path, "this file is no session", remedy)
    return None


MOST_NAMED = 4
"""Greatest number of nearby sessions in a message."""


def parse_session(
    path: Path, faults: list[Problem], *, as_sealed: bool = True, instead: Mapping[str, Path] | None = None
) -> SessionFolder | None:
    """Read a session; None with faults added to `faults`.

    Args:
        path: of the folder or the session file.
        instead: files that replace `machine` and `plan`.
    """
    wrong = _other_than_session(path)
    if wrong is not None:
        faults.append(wrong)
        return None
    file = path / SESSION_FILE if path.is_dir() else path
    folder = file.parent
    document, log = document_in_force(file, faults)
    if document is None:
        return None
    session = validate(document, SessionFile, folder)
    data = document.data
    named = {key: data.get(key) for key in ("machine", "plan")}
    paths = {key: folder / name for key, name in named.items() if isinstance(name, str)} | dict(instead or {})
    machine = parse_machine(paths["machine"], faults) if "machine" in paths else None
    plan = parse_plan(paths["plan"], faults) if "plan" in paths else None
    planned = None if plan is None else plan.to_domain()
    check_runs(document, planned, folder)
    check_set_up_errors(document, planned)
    if session is not None and planned is not None:
        check_bar(document, session.bar, planned)
    if session is None:
        return None
    entries, seal = session.runs, session.seal
    if as_sealed:
        broken = [] if seal is None else seal_faults(folder, file, seal, (session.machine, session.plan), entries)
        faults += [*broken, *log_faults(file, data, log, but_runs=any(one.file == str(file) for one in broken))]
    if machine is None or planned is None:
        return None
    try:
        digest = digest_of(file)
    except OSError as error:
        faults.append(unreadable(file, error))
        return None
    return SessionFolder(
        name=name_of(folder),
        folder=folder,
        machine=machine.to_domain(),
        plan=planned,
        machine_path=folder / session.machine,
        plan_path=folder / session.plan,
        runs=(*entries, *_unlisted(folder, entries, planned, faults)),
        sha256=digest,
        **{each.name: getattr(session, each.name) for each in fields(SessionDetails)},
    )


def _unlisted(folder: Path, entries: Sequence[RunEntry], plan: Plan, faults: list[Problem]) -> list[RunEntry]:
    listed = {run.path.name for run in entries}
    found = []
    for path in sorted(folder.glob(f"runs/*.csv{PART}"), key=lambda one: natural(one.name)):
        entry = None if path.name in listed else part_entry(path)
        if entry is not None and entry.test in plan.tests:
            found.append(entry)
        elif entry is not None:
            what = f"the plan has no test `{entry.test}`: this is a run of another plan"
            faults.append(Problem.of(path, what, line=1))
    return found


def unlisted_sealed(session: SessionFolder) -> tuple[Path, ...]:
    """Return sealed runs that the session file does not list."""
    listed = {run.path.name for run in session.runs}
    inside = sorted((session.folder / "runs").glob("*.csv"), key=lambda one: natural(one.name))
    return tuple(path for path in inside if path.name not in listed)


def part_entry(path: Path) -> RunEntry | None:
    """Return the entry that a run file states in its header, or None."""
    pieces = list(split_pieces([read_bytes(path, []) or b""], Faults(path)))
    header = pieces[0].header if pieces else {}
    repeat = count_in(header.get("repeat", ""))
    if not header.get("test") or header.get("direction") not in set(Direction) or repeat is None:
        return None
    return RunEntry(
        test=header["test"],
        direction=Direction(header["direction"]),
        repeat=repeat,
        state=RunState.RECORDING,
        path=path,
        counts=counts_in(header),
    )


def _header_faults(run: RunEntry, header: Mapping[str, str]) -> list[Problem]:
    faults = Faults(run.path)
    for key, expected in (("test", run.test), ("direction", str(run.direction)), ("repeat", str(run.repeat))):
        if header.get(key, expected) != expected:
            what = f"the file is {key} `{header[key]}`, the session calls it {key} `{expected}`"
            faults.add(what, "check which file belongs to which run")
    return faults
