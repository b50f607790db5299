"""Record the files that a command reads, by SHA-256, for outputs and log."""

from __future__ import annotations

import logging
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from dbbstation.files.places import real_path, text_of_name

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

Given = ParamSpec("Given")
Result = TypeVar("Result")

_LOG = logging.getLogger(__name__)


class InputBook:
    """Inputs in the order of their first reading."""

    def __init__(self, around: InputBook | None = None) -> None:
        self._digests: dict[Path, str] = {}
        self._read: set[Path] = set()
        self._around = around
        self.virtual: dict[str, None] = {}

    def note_read(self, path: Path) -> None:
        """Note that a file was read, without naming it in outputs."""
        self._read.add(real_path(path))

    def was_read(self, path: Path) -> bool:
        """Return whether this file was read before."""
        return real_path(path) in self._read

    def note_virtual(self, name: str) -> None:
        """Note that an input comes from a virtual machine, in enclosing books too."""
        self.virtual[name] = None
        if self._around is not None:
            self._around.note_virtual(name)

    def note(self, path: Path, digest: str) -> None:
        """Note a file and its hash; for a changed file the last hash counts."""
        self._digests[path.absolute()] = digest

    def named(self) -> dict[str, str]:
        """Return the SHA-256 of every input by name."""
        sessions = {path.parent for path in self._digests if path.name == "session.yaml"}
        named: dict[str, str] = {}
        for path, digest in self._digests.items():
            name = text_of_name(f"{path.parent.name}/{path.name}" if path.parent in sessions else path.name)
            if named.get(name, digest) != digest:
                name = next(f"{name} ({k})" for k in range(2, len(self._digests) + 2) if f"{name} ({k})" not in named)
            named[name] = digest
        return named


_BOOK: ContextVar[InputBook | None] = ContextVar("inputs", default=None)


def open_book() -> InputBook:
    """Return the open book, or a new one that is discarded."""
    return _BOOK.get() or InputBook()


@contextmanager
def input_book() -> Iterator[InputBook]:
    """Note every input that is read within the context."""
    book = InputBook(_BOOK.get())
    token = _BOOK.set(book)
    try:
        yield book
    finally:
        _BOOK.reset(token)


def in_a_book(task: Callable[Given, Result]) -> Callable[Given, Result]:
    """Let a task note its inputs outside of commands, so that Python scripts never overwrite an input."""

    @wraps(task)
    def call(*args: Given.args, **named: Given.kwargs) -> Result:
        with nullcontext() if _BOOK.get() is not None else input_book():
            return task(*args, **named)

    return call


def note_input(path: Path, digest: str) -> None:
    """Note and log a file that was read."""
    _LOG.info("read %s, sha256 %s", path, digest)
    open_book().note(path, digest)


def note_known(path: Path, digest: str) -> None:
    """Note a file known from an earlier reading."""
    book = open_book()
    book.note(path, digest)
    book.note_read(path)
