"""Read a text file whole; every failure is a `Problem`."""

from __future__ import annotations

import hashlib
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar, TypeVarTuple, Unpack

from dbbstation.errors import InputError, Problem
from dbbstation.files.gateway import LARGEST_BYTES, NotRegularError, TooLargeError, content_of, opened, sha256_hex
from dbbstation.files.inputs import note_input, open_book

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

_Found = TypeVar("_Found")
_Given = TypeVarTuple("_Given")


def read_bytes(
    path: Path, faults: list[Problem], largest: int = LARGEST_BYTES, *, is_input: bool = True
) -> bytes | None:
    """Return a file's bytes, or None with the reason added to `faults`.

    Args:
        is_input: outputs name the file, unless another input contains its hash.
    """
    try:
        data = content_of(path, largest)
    except OSError as error:
        faults.append(unreadable(path, error))
        return None
    open_book().note_read(path)
    if is_input:
        note_input(path, sha256_hex(data))
    return data


def blocks_of(path: Path) -> Iterator[bytes]:
    """Yield a file's bytes in blocks, and note it as an input.

    Raises:
        InputError: it cannot be read.
    """
    digest = hashlib.sha256()
    with readable(path), opened(path) as source:
        for block in source.blocks():
            digest.update(block)
            yield block
    open_book().note_read(path)
    note_input(path, digest.hexdigest())


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raise InputError if the file cannot be read."""
    try:
        yield
    except OSError as error:
        raise InputError([unreadable(path, error)]) from error


def unreadable(path: Path, error: OSError) -> Problem:
    """Return the problem of a file that cannot be read."""
    if isinstance(error, FileNotFoundError):
        return Problem.of(path, "there is no such file", "check the path")
    if isinstance(error, IsADirectoryError):
        return Problem.of(path, "this is a folder: name a file", "name a file in this folder")
    if isinstance(error, NotRegularError):
        return Problem.of(path, str(error.strerror), "write it to a file first")
    if isinstance(error, TooLargeError):
        return Problem.of(path, str(error.strerror), "check that it is the file you mean")
    why = (error.strerror or "unknown reason").lower()
    return Problem.of(path, f"cannot be read: {why}", "check its permissions and the disk")


def first_line(path: Path) -> bytes:
    """Return the first line that is neither empty nor a comment, or an empty text.

    Raises:
        OSError: it cannot be read.
    """
    with opened(path) as source:
        lines = lines_of(source.blocks())
        return next((line for line in lines if line.lstrip(_SPACE)[:1] not in {b"", b"#"}), b"")


def lines_of(blocks: Iterable[bytes]) -> Iterator[bytes]:
    """Yield lines without their ends; a text without line ends is divided into pieces."""
    left = b""
    for block in blocks:
        *whole, left = (left + block).split(b"\n")
        yield from whole
        if len(left) > LONGEST_LINE:
            yield left
            left = b""
    yield left


LARGEST_TABLE = 200_000_000
"""Largest table that is read as a whole [bytes]: a million rows of twenty columns, or a drive's seven million samples.
Its cells need ten times as much memory. Runs, which are longer, are read in blocks."""

LARGEST_SHEET = 20_000_000
"""Largest CMM report that is read [bytes]: a hundred thousand features."""

LARGEST_PROGRAM = 1_000_000
"""Largest Python file of the user's own that is read [bytes]: ten thousand lines."""

LONGEST_LINE = 1_000_000
"""Greatest number of kept bytes of a line; a row of a thousand columns has twenty thousand."""

_SPACE = b" \t\r\v\f\xef\xbb\xbf"


def decode(data: bytes, file: str, faults: list[Problem]) -> str | None:
    """Return `data` as UTF-8 text, or None with the first bad byte's place in `faults`."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        column = len(before) - (before.rfind(b"\n") + 1) + 1
        what = f"byte {data[error.start]:#04x} is not UTF-8 text"
        faults.append(Problem(file, line, column, what, "save the file as UTF-8"))
    return None


def without_faults(read: Callable[[Unpack[_Given], list[Problem]], _Found | None], *given: *_Given) -> _Found:
    """Call a reader that adds to a list of faults, and return its result.

    Raises:
        InputError: every fault with its place.
    """
    faults: list[Problem] = []
    found = read(*given, faults)
    if found is None or faults:
        raise InputError(faults)
    return found


def text_of(path: Path, largest: int = LARGEST_BYTES, *, is_input: bool = True) -> str:
    """Return a file's text.

    Raises:
        InputError: it cannot be read, or is no UTF-8.
    """
    return without_faults(lambda faults: text_in(path, faults, largest, is_input=is_input))


def text_in(path: Path, faults: list[Problem], largest: int = LARGEST_BYTES, *, is_input: bool = True) -> str | None:
    """Return the text of a UTF-8 file; None with the reason in `faults`."""
    data = read_bytes(path, faults, largest, is_input=is_input)
    return None if data is None else decode(data, str(path), faults)


def numbered_lines(text: str) -> list[tuple[int, str]]:
    """Return lines with their numbers, without comments and blank ones."""
    lines = enumerate(text.splitlines(), start=1)
    return [(number, line) for number, line in lines if line.strip() and not line.lstrip().startswith("#")]


def shortened(text: str) -> str:
    """Return a text shortened for a message."""
    return text if len(text) <= LONGEST_QUOTED else f"{text[:LONGEST_QUOTED]}…"


LONGEST_QUOTED = 60
"""Characters of a file's text that a message quotes."""
