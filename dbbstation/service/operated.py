"""An operator's job: its session and final answer."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dbbstation.errors import InputError, InstrumentError, Problem
from dbbstation.facts.serialise import as_objects
from dbbstation.files.atomic import write_text
from dbbstation.files.formats.job import JobFile, read_job
from dbbstation.files.formats.plan import plan_data, read_inline_plan
from dbbstation.files.formats.settings_schema import SettingsFile
from dbbstation.files.gateway import content_of
from dbbstation.files.places import SESSION_FILE, unused_path
from dbbstation.files.recordings.session import read_session
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import format_of, read_valid
from dbbstation.instrument.library import load_instrument
from dbbstation.quality.conformity import Conformity
from dbbstation.service.after import After
from dbbstation.service.choice import Choice
from dbbstation.service.memory import Line
from dbbstation.service.session_list import list_sessions
from dbbstation.service.session_notes import add_note
from dbbstation.service.work import BackgroundWork, SessionTask, WorkProgress
from dbbstation.station.opening import SHIFT_S

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.facts.held import ComparedTolerance
    from dbbstation.service.work import Call


@dataclass(frozen=True)
class Operated:
    """An operator's job and its file."""

    path: Path
    job: JobFile

    @property
    def sessions(self) -> Path:
        """Return the folder of the job's sessions."""
        return self._beside(self.job.sessions)

    def choice(self, *, anew: bool = False) -> Choice:
        """Return what to measure: the last session if it is incomplete and has the same plan, else a new one; with `anew` always a new one."""
        job = self.job
        line = Line(instrument=instrument_of(self.path, job), profile=job.profile, port=job.port, baud=job.baud)
        return Choice(
            folder=(None if anew else self._unfinished()) or self._new_folder(),
            machine=self._beside(job.machine),
            plan=self._beside(job.plan),
            line=line,
            bar=self._beside(job.bar) if job.bar else None,
            bar_waiver=job.bar_waiver,
            operator=job.operator,
            serial_number=job.serial_number,
            job=job.order,
        )

    def tolerances_file(self, session: Path) -> Path:
        """Write the job's tolerances as settings beside a session, note a change in the session, and return the file.

        Raises:
            OutputError: it cannot be written.
        """
        data = {"tolerances": [one.model_dump(exclude_defaults=True) for one in self.job.tolerances]}
        path = session.absolute().parent / f"{session.name}-tolerances.yaml"
        text = yaml_text({"format": format_of(SettingsFile), **data})
        before = content_of(path).decode(errors="replace") if path.is_file() else text
        if before != text and (session / SESSION_FILE).is_file():
            add_note(session, f"{_LIMITS}{' '.join(before.split())}")
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, text, force=True, rewrites=True)
        return path

    @property
    def model(self) -> Path | None:
        """Return the job's model, or None."""
        return self._beside(self.job.model) if self.job.model else None

    def left_long_ago(self, choice: Choice) -> bool:
        """Return whether the session to continue was last written before this shift."""
        if choice.folder is None or not choice.goes_on:
            return False
        return time.time() - (choice.folder / SESSION_FILE).stat().st_mtime > SHIFT_S

    def _beside(self, name: str) -> Path:
        return (self.path.parent / name).absolute()

    def _unfinished(self) -> Path | None:
        wanted = plan_data(read_inline_plan(self._beside(self.job.plan)))
        for line in list_sessions(self.sessions):
            mine = line.folder.parent == self.sessions and line.folder.name.startswith(f"{self.path.stem}-")
            if not mine or line.problem:
                continue
            if line.complete:
                return None
            return line.folder if plan_data(read_inline_plan(read_session(line.folder).plan_path)) == wanted else None
        return None

    def _new_folder(self) -> Path:
        name = f"{self.path.stem}-{datetime.now().astimezone():%Y-%m-%d}"
        return unused_path(self.sessions, name)


@dataclass(frozen=True)
class Answered:
    """The answer of a job on a session.

    Attributes:
        report: None if none was made.
    """

    word: Conformity
    reasons: tuple[str, ...]
    to_do: tuple[str, ...] = ()
    report: Path | None = None


class JobAnswer:
    """Makes a report that judges circles by the job's tolerances.

    Args:
        missing: planned runs without accepted recording, in words.
    """

    def __init__(
        self,
        operated: Operated,
        session: Path,
        missing: Sequence[str],
        start: Callable[[Call, Path], BackgroundWork] = BackgroundWork,
    ) -> None:
        self._missing, job = tuple(missing), operated.job
        tolerances = operated.tolerances_file(session)
        self._changed = any(note.text.startswith(_LIMITS) for note in read_session(session).notes)
        self._trouble = job.trouble
        self._after = After(session, operated.model, None, start, job.place, tolerances)
        self._after.do(SessionTask.REPORT)

    def look(self) -> Answered | None:
        """Return the answer; None until it is known."""
        self._after.look()
        result = self._after.results[SessionTask.REPORT]
        if result.progress in {None, WorkProgress.RUNNING}:
            return None
        if result.progress is not WorkProgress.DONE:
            why = result.failure or "the report was ended before it was done"
            return Answered(Conformity.UNDECIDED, (why,), (self._trouble or _SHOW,))
        answered = answer_of(as_objects(result.answer), self._missing, result.path, self._trouble)
        return replace(answered, reasons=(_CHANGED, *answered.reasons)) if self._changed else answered

    def close(self) -> None:
        """Cancel the work."""
        self._after.close()


def answer_of(
    answer: Any,  # noqa: ANN401 - a report as objects
    missing: Sequence[str],
    report: Path | None,
    trouble: str = "",
) -> Answered:
    """Return the answer of a report; it is complete only if every planned run is accepted."""
    verdict = answer.verdict
    kinds = {str(one): one for one in Conformity}
    word = kinds.get(verdict.kind, Conformity.UNDECIDED)
    # A report speaks of the shop's tolerances; here the job's hold.
    reasons = list(verdict.reasons) or [_WITHIN if word is Conformity.WITHIN else verdict.headline]
    to_do = [step for step in verdict.to_do if "`" not in step]
    if word is Conformity.WITHIN:
        reasons += [worst_of(one) for one in answer.tolerances if one.worst is not None]
    else:
        to_do.insert(0, trouble or _SHOW)
    if missing:
        word = word if word is Conformity.EXCEEDED else Conformity.UNDECIDED
        reasons.insert(0, f"Not measured: {', '.join(missing)}.")
        to_do.insert(0, "Measure what is missing: begin the job again.")
    return Answered(word, tuple(reasons), tuple(to_do), report)


def worst_of(one: ComparedTolerance) -> str:
    """Return a tolerance's worst circle with limit, U and margin."""
    worst = one.worst
    if worst is None:
        return ""
    expanded = worst.expanded_um or 0.0
    name, run = one.quantity.replace("-", " ").capitalize(), f"{worst.test} {worst.direction} {worst.repeat}"
    margin = one.largest_um - worst.um - expanded
    return f"{name}: {worst.um:.1f} µm at most ({run}), U {expanded:.1f} µm, limit {one.largest_um:g} µm, margin {margin:.1f} µm."


_LIMITS = "the limits of the job were changed, before: "
_SHOW = "Show this answer and its report to whoever prepared the job."
_CHANGED = "The limits of the job were changed during this session; its notes have the former ones."
_WITHIN = "Every circle is within the limits of the job, with its uncertainty."


def instrument_of(path: Path, job: JobFile) -> str:
    """Return a job's instrument name or protocol path, relative to the job."""
    named = job.instrument
    return str((path.parent / named).absolute()) if Path(named).suffix in {".yaml", ".yml"} else named


def instrument_faults(path: Path) -> list[Problem]:
    """Return faults of a job's instrument or variant."""
    read = read_valid(path, JobFile, [])
    if read is None:
        return []
    document, job = read
    try:
        load_instrument(instrument_of(path, job), job.profile or None)
    except InputError as error:
        return list(error.problems)
    except InstrumentError as error:
        return [document.problem(("instrument",), error.what, error.remedy)]
    return []


def read_operated(path: Path) -> Operated:
    """Read a job.

    Raises:
        InputError: every fault of it and its files.
    """
    if not path.is_file():
        raise InputError.of(path, "there is no such file", "check the path")
    job = read_job(path)
    if faults := instrument_faults(path):
        raise InputError(faults)
    return Operated(path.absolute(), job)
