"""What is done with a session once it is measured: calibrate, diagnose, write programs and report. Each is a task of the program."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.places import unused_path
from dbbstation.files.recordings.session import read_session
from dbbstation.service.former_sessions import keep_models
from dbbstation.service.job import SessionJob, SessionTask
from dbbstation.service.work import BackgroundWork, WorkProgress
from dbbstation.service.worked_out import DoneStep, counted, keep_steps, steps_before

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dbbstation.service.former_sessions import Former


USUAL = (SessionTask.CALIBRATE, SessionTask.DIAGNOSE, SessionTask.PROGRAMS, SessionTask.REPORT)
"""Steps on the session alone: an acceptance also needs one that was measured before."""

KINEMATIC, JOINT, PROGRAMS, REPORT = "model.yaml", "joint-model.yaml", "programs", "report.html"
ACCEPTANCE = "acceptance.html"
"""Names in the folder of results."""


@dataclass
class Result:
    """How a step stands.

    Attributes:
        progress: None: not begun.
        passed_s: time since it began, until it ended [s].
        answer: its result as JSON has it; empty until it is done.
        failure: what it said where it failed.
        path: what it wrote; None until it is done.
    """

    progress: WorkProgress | None = None
    stage: str = ""
    passed_s: float = 0.0
    answer: dict[str, object] = field(default_factory=dict)
    failure: str = ""
    path: Path | None = None


class After:
    """Works on one session, one step at a time; results go into a new folder beside it, or stand there from before.

    Args:
        model: of an earlier calibration, that the circles are held against until this one has a model; None: none.
        settings: file of the shop's settings where one was named; None: those that are found.
        start: begins a job, in a process of its own.

    Attributes:
        former: session that an acceptance holds it against; None: none was chosen.
        kept: copies of the models in force then.
    """

    def __init__(
        self,
        session: Path,
        model: Path | None = None,
        settings: Path | None = None,
        start: Callable[[SessionJob, Path], BackgroundWork] = BackgroundWork,
    ) -> None:
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
            self._folder, self._counted = before.folder, before.counted
            for name, one in before.steps.items():
                path = self._folder / one.path
                self.results[SessionTask(name)] = Result(WorkProgress.DONE, "", one.passed_s, one.answer, "", path)

    @property
    def folder(self) -> Path:
        """Folder of the results: made with the first step, never one that was there before."""
        if self._folder is None:
            self._folder = unused_path(self.session.parent, f"{self.session.name}-results")
        return self._folder

    @property
    def outdated(self) -> bool:
        """Whether the session, or the program, is another now than when the first step was done."""
        try:
            return self._counted not in {"", counted(self.session)}
        except (InputError, OSError):
            return False

    @property
    def busy(self) -> SessionTask | None:
        """The step that is being done."""
        return None if self._running is None else self._running[0]

    @property
    def model(self) -> Path | None:
        """The best model there is: of the diagnosis, of the calibration, an earlier one."""
        for step in (SessionTask.DIAGNOSE, SessionTask.CALIBRATE):
            if self.results[step].progress is WorkProgress.DONE:
                return self.results[step].path
        return self._model

    def can(self, step: SessionTask) -> bool:
        """Whether a step can be begun now."""
        lacking = {SessionTask.PROGRAMS: self.model is None, SessionTask.ACCEPTANCE: self.former is None}
        return self.busy is None and not lacking.get(step, False)

    def accept(self, former: Former) -> None:
        """Hold the session against one that was measured before; the models in force then are copied first.

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
        """Do these steps, one behind the other; a step that fails or is cancelled ends the row."""
        if self.busy is None:
            self._waiting = list(steps)
            self._next()

    def cancel(self) -> None:
        """End what is being done; what was done before stays."""
        self._waiting = []
        if self._running is not None:
            self._running[1].cancel()

    def look(self) -> None:
        """Take in how far the work has come; begin the next step where one has ended."""
        if self._running is None:
            return
        step, work = self._running
        result, progress = self.results[step], work.progress
        result.progress, result.stage, result.passed_s = progress, work.stage, work.passed_s
        if progress is WorkProgress.RUNNING:
            return
        if progress is WorkProgress.DONE:
            result.answer, result.path = work.answer(), self.folder / self._out(step)
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
        """End what is being done, and wait for that."""
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
        self._running = step, self._start(self._job(step), self.folder)

    def _job(self, step: SessionTask) -> SessionJob:
        job = SessionJob(
            task=step,
            beside=self.session.parent,
            out=self._out(step),
            session=self.session,
            settings=None if self._settings is None else self._settings.absolute(),
        )
        match step:
            case SessionTask.CALIBRATE | SessionTask.DIAGNOSE:
                return job
            case SessionTask.PROGRAMS:
                plan, machine = self._files()
                return job.model_copy(update={"plan": plan, "machine": machine, "model": self.model})
            case SessionTask.REPORT:
                return job.model_copy(update={"model": self.model})
            case SessionTask.ACCEPTANCE:
                if self.former is None:
                    raise ValueError("no session was chosen to hold this one against")
                return job.model_copy(update={"before": self.former.folder})

    def _files(self) -> tuple[Path, Path]:
        session = read_session(self.session)
        return session.plan_path.absolute(), session.machine_path.absolute()

    def _done(self) -> dict[str, DoneStep]:
        """What was done; a comparison is not kept: the session that it is with is chosen anew."""
        return {
            step.value: DoneStep(path=one.path.name, passed_s=one.passed_s, answer=one.answer)
            for step, one in self.results.items()
            if one.progress is WorkProgress.DONE and one.path is not None and step is not SessionTask.ACCEPTANCE
        }

    @staticmethod
    def _out(step: SessionTask) -> str:
        return {
            SessionTask.CALIBRATE: KINEMATIC,
            SessionTask.DIAGNOSE: JOINT,
            SessionTask.PROGRAMS: PROGRAMS,
            SessionTask.REPORT: REPORT,
            SessionTask.ACCEPTANCE: ACCEPTANCE,
        }[step]
