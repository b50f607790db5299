"""An operator's job: its session and final answer."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, InstrumentError, Problem
from dbbstation.facts.serialise import read_plain
from dbbstation.files.atomic import write_text
from dbbstation.files.formats.job import JobFile, read_job
from dbbstation.files.formats.plan import plan_data, read_inline_plan
from dbbstation.files.formats.settings_schema import SettingsFile
from dbbstation.files.places import unused_path
from dbbstation.files.recordings.session import read_session
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import format_of, read_document, validate
from dbbstation.instrument.library import load_instrument
from dbbstation.quality.conformity import Conformity
from dbbstation.service.after import After
from dbbstation.service.answers import ReportAnswer
from dbbstation.service.choice import Choice
from dbbstation.service.job import SessionTask
from dbbstation.service.memory import Line
from dbbstation.service.session_list import list_sessions
from dbbstation.service.work import BackgroundWork, WorkProgress

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.facts.held import ReportVerdict
    from dbbstation.service.job import SessionJob


@dataclass(frozen=True)
class Operated:
    """A job and its file.

    Attributes:
        path: its other files are relative to it.
    """

    path: Path
    job: JobFile

    @property
    def sessions(self) -> Path:
        """Return the folder of its sessions."""
        return self._beside(self.job.sessions)

    def choice(self) -> Choice:
        """Return what to measure: the last session if incomplete with the same plan, else a new one."""
        job = self.job
        line = Line(instrument=instrument_of(self.path, job), profile=job.profile, port=job.port, baud=job.baud)
        return Choice(
            folder=self._unfinished() or self._new_folder(),
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
        """Write the job's tolerances as settings beside a session and return the file.

        Raises:
            OutputError: it cannot be written.
        """
        data = {"tolerances": [one.model_dump(exclude_defaults=True) for one in self.job.tolerances]}
        path = session.absolute().parent / f"{session.name}-tolerances.yaml"
        write_text(path, yaml_text({"format": format_of(SettingsFile), **data}), force=True, rewrites=True)
        return path

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
    """The answer on a session.

    Attributes:
        to_do: in order.
        report: None if none was made.
    """

    word: Conformity
    reasons: tuple[str, ...]
    to_do: tuple[str, ...] = ()
    report: Path | None = None


class JobAnswer:
    """Judges circles by the job's tolerances with a report.

    Args:
        missing: planned runs without accepted recording, in words.
        start: begins a job in a process.
    """

    def __init__(
        self,
        operated: Operated,
        session: Path,
        missing: Sequence[str],
        start: Callable[[SessionJob, Path], BackgroundWork] = BackgroundWork,
    ) -> None:
        self._missing = tuple(missing)
        self._after = After(session, None, operated.tolerances_file(session), start)
        self._after.do(SessionTask.REPORT)

    def look(self) -> Answered | None:
        """Return the answer; None until known."""
        self._after.look()
        result = self._after.results[SessionTask.REPORT]
        if result.progress in {None, WorkProgress.RUNNING}:
            return None
        if result.progress is not WorkProgress.DONE:
            return Answered(Conformity.UNDECIDED, (result.failure or "the report was ended before it was done",))
        return answer_of(read_plain(ReportAnswer, result.answer).verdict, self._missing, result.path)

    def close(self) -> None:
        """Cancel the work."""
        self._after.close()


def answer_of(verdict: ReportVerdict, missing: Sequence[str], report: Path | None) -> Answered:
    """Return the answer of a verdict, which is complete only with every planned run.

    A limit is exceeded whatever is missing.
    """
    kinds = {str(one): one for one in Conformity}
    word = kinds.get(verdict.kind, Conformity.UNDECIDED)
    # A report speaks of the shop's tolerances; here the job's hold.
    reasons = list(verdict.reasons) or [_WITHIN if word is Conformity.WITHIN else verdict.headline]
    to_do = list(verdict.to_do)
    if missing:
        word = word if word is Conformity.EXCEEDED else Conformity.UNDECIDED
        reasons.insert(0, f"Not measured: {', '.join(missing)}.")
        to_do.insert(0, "Measure what is missing: begin the job again.")
    return Answered(word, tuple(reasons), tuple(to_do), report)


_WITHIN = "Every circle is within the limits of the job, with its uncertainty."


def instrument_of(path: Path, job: JobFile) -> str:
    """Return a job's instrument name or protocol path, relative to the job."""
    named = job.instrument
    return str((path.parent / named).absolute()) if Path(named).suffix in {".yaml", ".yml"} else named


def instrument_faults(path: Path) -> list[Problem]:
    """Return faults of a job's instrument or variant."""
    faults: list[Problem] = []
    document = read_document(path, JobFile, faults)
    job = None if document is None else validate(document, JobFile, faults)
    if document is None or job is None:
        return []
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
        raise InputError([Problem(str(path), 0, 0, "there is no such file", "check the path")])
    job = read_job(path)
    if faults := instrument_faults(path):
        raise InputError(faults)
    return Operated(path.absolute(), job)
