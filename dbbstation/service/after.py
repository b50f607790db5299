"""Tasks on a measured session."""

from __future__ import annotations

import glob
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, ValidationError

from dbbstation.circles.path import TOLERATED
from dbbstation.errors import InputError, OutputError
from dbbstation.files.atomic import write_text
from dbbstation.files.gateway import content_of
from dbbstation.files.keys import digests_of, files_of_session, key_of
from dbbstation.files.places import real_path, unused_path
from dbbstation.files.recordings.session import read_session
from dbbstation.service.former_sessions import keep_models
from dbbstation.service.work import BackgroundWork, Call, SessionTask, WorkProgress

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dbbstation.service.former_sessions import Former


FILE = "worked-out.json"
"""File that lists finished steps, in the folder of results."""

LARGEST_BYTES = 50_000_000
"""Largest list of steps that is read; it contains the commands' answers, some megabytes for a large session."""


class DoneStep(BaseModel):
    """A finished step."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: str
    """Its output in the folder of results."""
    passed_s: float
    """Its duration [s]."""
    answer: dict[str, object]
    """The answer that its command printed."""


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    key: str
    """Key of the inputs, from `counted`."""
    steps: dict[str, DoneStep]


def keep_steps(folder: Path, key: str, steps: dict[str, DoneStep]) -> None:
    """Write finished steps beside their results, if possible; keep steps of another screen on this session."""
    with suppress(OSError, OutputError):
        before = _kept(folder / FILE)
        if before is not None and before.key == key:
            steps = before.steps | steps
        file = _File(key=key, steps=steps)
        write_text(folder / FILE, file.model_dump_json(indent=1) + "\n", force=True, rewrites=True)


def steps_before(session: Path) -> tuple[Path, str, dict[str, DoneStep]] | None:
    """Return folder, key and steps of the last results of an unchanged session, or None."""
    session = session.absolute()
    kept = sorted(
        session.parent.glob(f"{glob.escape(session.name)}-results*/{FILE}"), key=lambda file: -file.stat().st_mtime
    )
    try:
        now = counted(session) if kept else ""
    except (InputError, OSError):  # what is wrong with it is said where it is opened
        return None
    for file in kept:
        found = _kept(file)
        if found is not None and found.key == now:
            folder = file.parent
            steps = {name: step for name, step in found.steps.items() if _is_result(folder, name, step)}
            return folder, now, steps
    return None


def _kept(file: Path) -> _File | None:
    try:
        return _File.model_validate_json(content_of(file, LARGEST_BYTES))
    except (OSError, ValidationError):
        return None


def _is_result(folder: Path, name: str, step: DoneStep) -> bool:
    path = folder / step.path
    return name in set(SessionTask) and path.exists() and real_path(path).is_relative_to(real_path(folder))


def counted(session: Path) -> str:
    """Return the key of a session's results, which depends on its files and the program.

    Raises:
        InputError: faults of the session.
        OSError: a file cannot be read.
    """
    found = read_session(session)
    return key_of({"task": "steps"}, digests_of(files_of_session(found), found.folder))


USUAL = (SessionTask.CALIBRATE, SessionTask.DIAGNOSE, SessionTask.PROGRAMS, SessionTask.REPORT)
"""Steps that need this session only; an acceptance also needs an earlier session."""

_OF_OTHERS = {SessionTask.ACCEPTANCE, SessionTask.HISTORY}
"""Steps whose result depends on other sessions."""

KINEMATIC, JOINT = "model.yaml", "joint-model.yaml"

_CALLED = {
    SessionTask.CALIBRATE: ("calibrate", "out", KINEMATIC),
    SessionTask.DIAGNOSE: ("diagnose", "out", JOINT),
    SessionTask.PROGRAMS: ("program", "", "programs"),
    SessionTask.REPORT: ("report", "", "report.html"),
    SessionTask.ACCEPTANCE: ("report", "", "acceptance.html"),
    SessionTask.FIGURES: ("circles", "figure", "circles.pdf"),
    SessionTask.HISTORY: ("history", "page", "history.html"),
}
"""Output of a step that is no parameter of its task, and the name of its result in the folder of results."""


@dataclass
class Result:
    """State of a step.

    Attributes:
        answer: JSON of its result; empty until done.
        path: its output; None until done.
    """

    progress: WorkProgress | None = None
    stage: str = ""
    passed_s: float = 0.0
    answer: dict[str, object] = field(default_factory=dict)
    failure: str = ""
    path: Path | None = None


class After:
    """Evaluates one session step by step; a new folder beside it gets the results.

    Args:
        model: of an earlier calibration, for comparison until a new one exists; None: none.
        settings: named file of the shop's settings; None: searched for.
        tolerances: settings with an operator's tolerances, which replace the shop's; None: none.

    Attributes:
        former: session compared by an acceptance, or None.
    """

    def __init__(
        self,
        session: Path,
        model: Path | None = None,
        settings: Path | None = None,
        start: Callable[[Call, Path], BackgroundWork] = BackgroundWork,
        place: str = "",
        tolerances: Path | None = None,
    ) -> None:
        self._place, self._tolerances = place, tolerances
        self.session = session.absolute()
        self.results = {step: Result() for step in SessionTask}
        self._model = model
        self._settings = settings
        self._start = start
        self._folder: Path | None = None
        self._running: tuple[SessionTask, BackgroundWork] | None = None
        self._waiting: list[SessionTask] = []
        self.former: Former | None = None
        self.kept: tuple[Path, ...] = ()
        self._counted = ""
        before = steps_before(self.session)
        if before is not None:
            self._folder, self._counted, steps = before
            for name, one in steps.items():
                path = self._folder / one.path
                self.results[SessionTask(name)] = Result(WorkProgress.DONE, "", one.passed_s, one.answer, "", path)

    @property
    def folder(self) -> Path:
        """Return the folder of results; the first step makes it."""
        if self._folder is None:
            self._folder = unused_path(self.session.parent, f"{self.session.name}-results")
        return self._folder

    @property
    def outdated(self) -> bool:
        """Return whether session or program changed since the first step."""
        try:
            return self._counted not in {"", counted(self.session)}
        except (InputError, OSError):
            return False

    @property
    def busy(self) -> SessionTask | None:
        """Return the running step."""
        return None if self._running is None else self._running[0]

    @property
    def model(self) -> Path | None:
        """Return the best model: from the diagnosis, else the calibration, else an earlier one."""
        for step in (SessionTask.DIAGNOSE, SessionTask.CALIBRATE):
            if self.results[step].progress is WorkProgress.DONE:
                return self.results[step].path
        return self._model

    def can(self, step: SessionTask) -> bool:
        """Return whether a step can begin."""
        lacking = {SessionTask.PROGRAMS: self.model is None, SessionTask.ACCEPTANCE: self.former is None}
        return self.busy is None and not lacking.get(step, False)

    def accept(self, former: Former) -> None:
        """Choose an earlier session for the comparison and copy its models.

        Raises:
            OutputError: a copy cannot be written.
            OSError: a model cannot be read.
        """
        if self.busy is not None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        self.former, self.kept = former, keep_models(former, self.folder)
        self.do(SessionTask.ACCEPTANCE)

    def do(self, *steps: SessionTask) -> None:
        """Do steps in order; a failed or cancelled step ends the series."""
        if self.busy is None:
            self._waiting = list(steps)
            self._next()

    def cancel(self) -> None:
        """Cancel the running step; earlier results stay."""
        self._waiting = []
        if self._running is not None:
            self._running[1].cancel()

    def look(self) -> None:
        """Read the progress and begin the next step."""
        if self._running is None:
            return
        step, work = self._running
        result, progress = self.results[step], work.progress
        result.progress, result.stage, result.passed_s = progress, work.stage, work.passed_s
        if progress is WorkProgress.RUNNING:
            return
        if progress is WorkProgress.DONE:
            result.answer, result.path = work.answer(), self.folder / _CALLED[step][2]
            with suppress(InputError, OSError):
                now = counted(self.session)
                keep_steps(self.folder, now, self._done())
                self._counted = self._counted or now
        elif progress is WorkProgress.FAILED:
            result.failure = work.failure()
        work.close()
        self._running = None
        if progress is WorkProgress.DONE:
            self._next()
        else:
            self._waiting = []

    def close(self) -> None:
        """Cancel the running step and wait."""
        self._waiting = []
        if self._running is not None:
            self._running[1].close()
            self._running = None

    def _next(self) -> None:
        if not self._waiting:
            return
        step = self._waiting.pop(0)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.results[step] = Result(WorkProgress.RUNNING)
        self._running = step, self._start(self._call(step), self.folder)

    def _call(self, step: SessionTask) -> Call:
        (task, output, file), given = _CALLED[step], {"sessions": str(self.session)}
        match task:
            case "program":
                session = read_session(self.session)
                plan, machine = session.plan_path.absolute(), session.machine_path.absolute()
                given = {"plan": str(plan), "machine": str(machine), "out": file}
            case "report":
                given |= {"page": file}
            case "circles":
                given |= {"filter": str(TOLERATED.value)}
            case "history":
                given = {"folder": str(self.session.parent)}
        if step is SessionTask.ACCEPTANCE:
            if self.former is None:
                raise ValueError("no session was chosen for the comparison")
            given |= {"before": str(self.former.folder)}
        if step in {SessionTask.PROGRAMS, SessionTask.REPORT} and self.model is not None:
            given |= {"model": str(self.model)}
        if step is SessionTask.REPORT and self._place:
            given |= {"place": self._place}
        return Call(
            task=task,
            given=given,
            outputs={output: file} if output else {},
            beside=self.session.parent,
            settings=None if self._settings is None else self._settings.absolute(),
            tolerances=self._tolerances if step is SessionTask.REPORT else None,
        )

    def _done(self) -> dict[str, DoneStep]:
        return {
            step.value: DoneStep(path=one.path.name, passed_s=one.passed_s, answer=one.answer)
            for step, one in self.results.items()
            if one.progress is WorkProgress.DONE and one.path is not None and step not in _OF_OTHERS
        }
