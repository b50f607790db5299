"""The log of commands for service: request, versions, inputs, messages, end.

The log is one file in the user's log folder, rotated by size. Events of a measurement are in the session's own log.
"""

from __future__ import annotations

import functools
import logging
import os
import platform
import shlex
import stat
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, TypeVar

import click

from dbbstation.cli.output import PROGRAM, command_of
from dbbstation.errors import unwritable
from dbbstation.files.inputs import open_book
from dbbstation.files.places import session_around
from dbbstation.system.handles import open_nothing, open_private
from dbbstation.text.written import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

LOG = logging.getLogger("dbbstation")

FILE = "dbbstation.log"
"""Name of the log in the user's folder."""

VARIABLE = "DBBSTATION_LOG"
"""Environment variable that names another file; `off` for none."""

LARGEST_BYTES, KEPT = 1_000_000, 3
"""Size at which the log is rotated [bytes], and number of older files: some thousand commands, 4 MB in all."""

_VERSIONS = ("numpy", "scipy", "numba", "matplotlib", "pydantic", "pyserial", "textual")
"""Packages whose versions matter for a fault."""


class _Printable(logging.Formatter):
    """Makes log records safe for a terminal."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record))


_FORM = _Printable("%(asctime)s %(process)d %(levelname)s %(message)s", "%Y-%m-%dT%H:%M:%S%z")


def attended(command: click.Command) -> click.Command:
    """Let a command write the log once."""
    callback = command.callback
    if callback is None or isinstance(command, click.Group) or hasattr(callback, "attended"):
        return command

    @functools.wraps(callback)
    def call(*args: Any, **named: Any) -> Any:  # noqa: ANN401 - what the command takes and returns
        with _kept(click.get_current_context()):
            return callback(*args, **named)

    call.attended = True  # type: ignore[attr-defined]  # a mark for this function
    command.callback = call
    return command


@contextmanager
def _kept(context: click.Context) -> Iterator[None]:
    verbose = bool(context.find_root().params.get("verbose"))
    handlers = [_to_file(), _to_screen() if verbose else None]
    used = [handler for handler in handlers if handler is not None] or [logging.NullHandler()]
    before = LOG.level
    for handler in used:
        LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    started_s = time.monotonic()
    try:
        _log_beginning(context)
        yield
    except (click.Abort, KeyboardInterrupt):
        LOG.warning("interrupted after %.1f s", time.monotonic() - started_s)
        raise
    except (click.exceptions.Exit, BrokenPipeError):
        LOG.info("ended after %.1f s", time.monotonic() - started_s)
        raise
    except Exception:
        LOG.exception("failed after %.1f s", time.monotonic() - started_s)
        raise
    else:
        LOG.info("done in %.1f s", time.monotonic() - started_s)
    finally:
        LOG.setLevel(before)
        for handler in used:
            LOG.removeHandler(handler)
            handler.close()


def _log_beginning(context: click.Context) -> None:
    given = context.obj if isinstance(context.obj, tuple) else shlex.split(command_of(context))[1:]
    LOG.info("$ %s", shlex.join(["dbbstation", *given]))
    LOG.info("%s, Python %s, %s, in %s", PROGRAM, platform.python_version(), platform.platform(), Path.cwd())
    LOG.info(_versions())
    for name, digest in open_book().named().items():
        LOG.info("settings %s, sha256 %s", name, digest)
    if command_of(context) != shlex.join(["dbbstation", *given]):
        LOG.info("with settings, files without folders: %s", command_of(context))


@functools.cache  # reading what each package says of itself takes as long as a short command
def _versions() -> str:
    from importlib.metadata import PackageNotFoundError, version

    found = []
    for package in _VERSIONS:
        with suppress(PackageNotFoundError):
            found.append(f"{package} {version(package)}")
    return ", ".join(found)


def _to_screen() -> logging.Handler:
    screen = _undisturbing(logging.StreamHandler)(sys.stderr)
    screen.setFormatter(_Printable("log: %(message)s"))
    screen.addFilter(lambda record: not record.exc_info and not getattr(record, "said", False))
    return screen


def _to_file() -> logging.Handler | None:
    """Return the log's handler, or None if disabled or unwritable."""
    from logging.handlers import RotatingFileHandler

    named = os.environ.get(VARIABLE)
    if named == "off":
        return None
    path = Path(named) if named else _usual_place()
    # A log is no reason to fail: there may be no place where this user may write.
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        if _free(path):
            file = _undisturbing(RotatingFileHandler)(path, maxBytes=LARGEST_BYTES, backupCount=KEPT, encoding="utf-8")
            file.setFormatter(_FORM)
            return file
    return None


def _free(path: Path) -> bool:
    if session_around(path) is not None:
        return False
    try:
        found = path.stat()
    except FileNotFoundError:
        return True
    return stat.S_ISREG(found.st_mode) and found.st_nlink == 1


_Kind = TypeVar("_Kind", bound=logging.Handler)


def _undisturbing(kind: type[_Kind]) -> type[_Kind]:
    """Return a handler that stays silent if it cannot write."""

    class Undisturbing(kind):  # type: ignore[misc, valid-type]  # a kind that is known here only
        def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802, ARG002 - called so by the library
            self.addFilter(lambda _record: False)

        def _open(self) -> IO[str]:  # called so by the library
            # Command lines hold operators' names.
            return open(self.baseFilename, self.mode, encoding=self.encoding, opener=open_private)

        def close(self) -> None:
            with suppress(OSError):
                super().close()

    return Undisturbing


def _usual_place() -> Path:
    import platformdirs

    return platformdirs.user_log_path("dbbstation", appauthor=False) / FILE


_STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))


def open_missing() -> None:
    """Open missing streams on the null device, so that no later file replaces them."""
    for number, (name, mode) in enumerate(_STREAMS):
        try:
            os.fstat(number)
        except OSError:
            opened = open_nothing()  # the lowest number that is free: this one
            os.set_inheritable(opened, True)  # noqa: FBT003 - taken by its place alone
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))


def flush_output() -> None:
    """Flush the output.

    Raises:
        BrokenPipeError: its reader is gone.
        OutputError: its disk refuses.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise unwritable(error, "standard output") from error


def drop_unwritable() -> None:
    """Discard unwritable output, which the interpreter would retry."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        drop_output()


def drop_output() -> None:
    """Flush remaining output into nothing."""
    os.dup2(open_nothing(), sys.stdout.fileno())
