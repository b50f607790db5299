"""Which files a command has read, by SHA-256: what outputs and the log say of their inputs."""

from __future__ import annotations

import logging
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from dbbstation.files.places import real_path, text_of_name

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

_LOG = logging.getLogger(__name__)


class InputBook:
    """Inputs in the order in which they were first read."""

    def __init__(self) -> None:
        self._digests: dict[Path, str] = {}
        self._read: set[Path] = set()

    def note_read(self, path: Path) -> None:
        """Note that a file was read, whether or not outputs name it among their inputs."""
        self._read.add(real_path(path))

    def was_read(self, path: Path) -> bool:
        """Whether a file was read so far."""
        return real_path(path) in self._read

    def note(self, path: Path, digest: str) -> None:
        """Note a file; one that is read again after a change counts as it was last."""
        self._digests[path.absolute()] = digest

    def named(self) -> dict[str, str]:
        """Return the SHA-256 of every input by name.

        A name is that of the file without its folders, so that the same files give the same text on every computer. Files
        of a session have the session's name before theirs; of two other files with one name the second is numbered.
        """
        sessions = {path.parent for path in self._digests if path.name == "session.yaml"}
        named: dict[str, str] = {}
        for path, digest in self._digests.items():
            name = text_of_name(f"{path.parent.name}/{path.name}" if path.parent in sessions else path.name)
            if named.get(name, digest) != digest:
                name = next(f"{name} ({k})" for k in range(2, len(self._digests) + 2) if f"{name} ({k})" not in named)
            named[name] = digest
        return named


_BOOK: ContextVar[InputBook | None] = ContextVar("inputs", default=None)


@contextmanager
def input_book() -> Iterator[InputBook]:
    """Note every input that is read from here on."""
    book = InputBook()
    token = _BOOK.set(book)
    try:
        yield book
    finally:
        _BOOK.reset(token)


def note_input(path: Path, digest: str) -> None:
    """Note and log a file that was read, with its SHA-256; only logged where nobody keeps a book."""
    _LOG.info("read %s, sha256 %s", path, digest)
    book = _BOOK.get()
    if book is not None:
        book.note(path, digest)


def note_known(path: Path, digest: str) -> None:
    """Note a file whose content is known from an earlier reading."""
    book = _BOOK.get()
    if book is not None:
        book.note(path, digest)
        book.note_read(path)


def note_read(path: Path) -> None:
    """Note that a file was read, so that no output takes its place."""
    book = _BOOK.get()
    if book is not None:
        book.note_read(path)


def was_read(path: Path) -> bool:
    """Whether this command has read a file; False where nobody keeps a book."""
    book = _BOOK.get()
    return book is not None and book.was_read(path)


def inputs_so_far() -> dict[str, str]:
    """Return the SHA-256 of every input so far by name; empty where nobody keeps a book."""
    book = _BOOK.get()
    return {} if book is None else book.named()
