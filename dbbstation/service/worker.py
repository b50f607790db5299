"""The process of a station's task: `python -m dbbstation.service.worker`.

It reads its job as one line of JSON and is interrupted when its input ends. Stages and notes go to standard error, the
JSON result to standard output. Only this module of the service loads tasks.
"""

from __future__ import annotations

import _thread
import json
import logging
import os
import sys
import threading
from typing import TYPE_CHECKING

from dbbstation.errors import StationError, in_a_sentence
from dbbstation.files.formats.settings import read_settings, settings_files
from dbbstation.files.inputs import input_book
from dbbstation.service.work import LOG_MARK, STAGE_MARK, Call

if TYPE_CHECKING:
    from collections.abc import Mapping

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
            call = Call.model_validate_json(sys.stdin.readline())
            threading.Thread(target=_interrupted_at_the_end, name="input", daemon=True).start()
            answer = done(call)
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


def done(call: Call) -> Mapping[str, object]:
    """Do a task in the working folder; return its JSON result.

    Raises:
        StationError: an error of the task.
    """
    from dbbstation.facts.serialise import plain  # noqa: PLC0415 - the call is read before half a second of imports
    from dbbstation.tasks.called import called  # noqa: PLC0415 - the same

    shops = settings_files(call.beside) if call.settings is None else [call.settings]
    settings = read_settings([*([] if call.tolerances is None else [call.tolerances]), *shops])
    return plain(called(call.task, call.given, call.outputs, settings, force=call.force, progress=_stage, say=_note))


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
