"""The process of a station's task: `python -m dbbstation.service.worker`.

It reads its job as one line of JSON and is interrupted when its input ends. Stages and notes go to standard error, the
JSON result to standard output. Only this module of the service loads tasks.
"""

from __future__ import annotations

import _thread
import json
import logging
import os
import shlex
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation import __version__
from dbbstation.errors import StationError
from dbbstation.files.formats.settings import read_settings, settings_files
from dbbstation.files.inputs import input_book, inputs_so_far, virtual_so_far
from dbbstation.files.places import name_of
from dbbstation.files.provenance import Provenance
from dbbstation.files.refused import in_a_sentence
from dbbstation.service.job import SessionJob, SessionTask
from dbbstation.service.work import LOG_MARK, STAGE_MARK

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.files.formats.settings import Settings

FAILED, INTERRUPTED = 1, 130
"""Exit codes: the work failed, with the reason on standard error; the work was interrupted."""

_LOG = logging.getLogger(__name__)


class _Marked(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        """Return a record's lines."""
        return "\n".join(LOG_MARK + line for line in super().format(record).splitlines())


def main() -> None:
    """Read a job from standard input, do it, and exit with a code."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Marked())
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    logging.captureWarnings(capture=True)
    try:
        with input_book():
            job = SessionJob.model_validate_json(sys.stdin.readline())
            threading.Thread(target=_interrupted_at_the_end, name="input", daemon=True).start()
            answer = done(job)
        sys.stdout.write(json.dumps(answer, allow_nan=False))
        sys.stdout.flush()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except StationError as problem:
        _fail(str(problem))
    except OSError as problem:
        _fail(in_a_sentence(problem))
    except Exception as problem:  # noqa: BLE001 - said in words; the log has where it happened
        _LOG.exception("the work crashed")
        _fail(
            f"{type(problem).__name__}: {problem}\nthis is a fault of dbbstation itself; the log shows what to report"
        )


def _interrupted_at_the_end() -> None:
    # Not by `sys.stdin`: its lock would be held when the interpreter ends.
    while os.read(sys.stdin.fileno(), 1):
        pass
    _thread.interrupt_main()


def done(job: SessionJob) -> Mapping[str, object]:
    """Do a job in the working folder; return its JSON result.

    Raises:
        StationError: as of the task.
        ValueError: the job lacks a file.
    """
    from dbbstation.facts.serialise import plain  # noqa: PLC0415 - the job is read before half a second of imports

    shops = settings_files(job.beside) if job.settings is None else [job.settings]
    settings = read_settings([*([] if job.tolerances is None else [job.tolerances]), *shops])
    match job.task:
        case SessionTask.CALIBRATE | SessionTask.DIAGNOSE:
            return plain(_fitted(job))
        case SessionTask.PROGRAMS:
            return plain(_programs(job, settings))
        case SessionTask.REPORT | SessionTask.ACCEPTANCE:
            return plain(_reported(job, settings))
        case SessionTask.FIGURES | SessionTask.HISTORY:
            return plain(_drawn(job, settings))


def _fitted(job: SessionJob) -> object:
    from dbbstation.files.formats.model import write_model  # noqa: PLC0415 - the same
    from dbbstation.tasks.calibrate import calibrate  # noqa: PLC0415 - the same
    from dbbstation.tasks.diagnose import diagnose  # noqa: PLC0415 - the same

    session = _needed(job.session, "session")
    fit = calibrate if job.task is SessionTask.CALIBRATE else diagnose
    result = fit(session, progress=_stage, say=_note)
    write_model(Path(job.out), result.model, provenance=_provenance(job.task.value, session), force=job.force)
    return result


def _programs(job: SessionJob, settings: Settings) -> object:
    from dbbstation.tasks.circle_programs import program  # noqa: PLC0415 - the same

    plan, machine = _needed(job.plan, "plan"), _needed(job.machine, "machine")
    chosen = {
        option: settings.values[key].value
        for option, key in (
            ("dialect", "program.dialect"),
            ("step_deg", "program.step_deg"),
            ("clearance_mm", "program.clearance_mm"),
            ("largest_correction_mm", "limits.largest_correction_mm"),
        )
        if key in settings.values
    }
    words: list[str] = [
        word for option, value in chosen.items() for word in (f"--{option.replace('_', '-')}", str(value))
    ]
    of_model: list[str | Path] = [] if job.model is None else ["--model", job.model]
    return program(
        plan=plan,
        machine=machine,
        out=job.out,
        model=job.model,
        **chosen,
        force=job.force,
        provenance=lambda: _provenance("program", "--plan", plan, "--machine", machine, *of_model, *words),
        progress=_stage,
        say=_note,
    )


def _reported(job: SessionJob, settings: Settings) -> object:
    from dbbstation.tasks.report import report  # noqa: PLC0415 - the same

    session = _needed(job.session, "session")
    given = [word for name in ("model", "before") if (path := getattr(job, name)) for word in (f"--{name}", path)]
    given += ["--place", job.place] if job.place else []
    return report(
        session,
        job.out,
        settings=settings,
        before=job.before,
        model=job.model,
        place=job.place,
        force=job.force,
        provenance=lambda: _provenance("report", session, *given),
        progress=_stage,
    )


def _drawn(job: SessionJob, settings: Settings) -> object:
    from dbbstation.tasks.pages import draw_circles, draw_history  # noqa: PLC0415 - the same
    from dbbstation.tasks.telling import Telling  # noqa: PLC0415 - the same

    session, out, telling = _needed(job.session, "session"), Path(job.out), Telling(_stage, say=_note)
    if job.task is SessionTask.FIGURES:
        return draw_circles(
            session,
            out,
            lambda: _provenance("circles", session, "--filter", "30", "--figure", out),
            telling,
            force=job.force,
        )
    words = ("history", job.beside, "--page", out)
    return draw_history(job.beside, out, settings, lambda: _provenance(*words), telling, force=job.force)


def _needed(path: Path | None, what: str) -> Path:
    if path is None:
        raise ValueError(f"the job has no {what}")
    return path


def _provenance(*words: str | Path) -> Provenance:
    command = shlex.join(["dbbstation", *(name_of(word) if isinstance(word, Path) else word for word in words)])
    return Provenance(f"dbbstation {__version__}", command, inputs_so_far(), virtual_so_far())


def _stage(text: str, done: int = 0, of: int = 0) -> None:  # noqa: ARG001 - as `Progress` has it; the station shows no counts
    _tell(STAGE_MARK + text)


def _note(text: str) -> None:
    _tell(f"note: {text}")


def _tell(text: str) -> None:
    sys.stderr.write(text + "\n")
    sys.stderr.flush()


def _fail(text: str) -> None:
    _tell(text)
    sys.exit(FAILED)


if __name__ == "__main__":
    main()
