"""Reading a text file whole, with every reason why that may fail said as a `Problem`."""

from __future__ import annotations

import stat
from typing import TYPE_CHECKING

from dbbstation.errors import Problem
from dbbstation.files.inputs import note_input, note_read

if TYPE_CHECKING:
    from pathlib import Path


LARGEST_BYTES = 2_000_000_000
"""Largest file that is read: an hour at a hundred thousand readings a second makes about as much."""


def read_bytes(
    path: Path, faults: list[Problem], largest: int = LARGEST_BYTES, *, is_input: bool = True
) -> bytes | None:
    """Return a file's bytes, or None with the reason added to `faults`.

    Regular files only: a pipe would be waited for and a device never ends.

    Args:
        path: of the file.
        faults: take the reason.
        largest: number of bytes that are read at the most.
        is_input: outputs name it among their inputs; not so where the hash of the file stands in another input.
    """
    try:
        data = _bounded(path, faults, largest)
    except FileNotFoundError:
        faults.append(Problem(str(path), 0, 0, "there is no such file", "check the path"))
    except IsADirectoryError:
        faults.append(Problem(str(path), 0, 0, "this is a folder, a file is needed", "name the file in it"))
    except OSError as error:
        why = (error.strerror or "unknown reason").lower()
        faults.append(Problem(str(path), 0, 0, f"cannot be read: {why}", "check its permissions and the disk"))
    else:
        if data is not None:
            note_read(path)
            if is_input:
                note_input(path, data)
        return data
    return None


def _bounded(path: Path, faults: list[Problem], largest: int) -> bytes | None:
    found = path.stat()
    if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
        what = "this is a pipe or a device, a file is needed"
        faults.append(Problem(str(path), 0, 0, what, "write it to a file first"))
        return None
    if found.st_size > largest:
        what = f"the file has {found.st_size:,} bytes, at most {largest:,} are read"
        faults.append(Problem(str(path), 0, 0, what, "check that it is the file you mean"))
        return None
    with path.open("rb") as file:
        data = file.read(largest + 1)
    if len(data) > largest:
        faults.append(Problem(str(path), 0, 0, f"the file goes on beyond {largest:,} bytes", "check which file it is"))
        return None
    return data


def decode(data: bytes, file: str, faults: list[Problem]) -> str | None:
    """Return the UTF-8 text of `data`, or None with the place of the first bad byte added to `faults`."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        column = len(before) - (before.rfind(b"\n") + 1) + 1
        what = f"byte {data[error.start]:#04x} is not UTF-8 text"
        faults.append(Problem(file, line, column, what, "save the file as UTF-8"))
    return None


def shortened(text: str) -> str:
    """Text as it is quoted in a message: of a long one its beginning."""
    return text if len(text) <= LONGEST_QUOTED else f"{text[:LONGEST_QUOTED]}…"


LONGEST_QUOTED = 60
"""Characters of a file's text that a message quotes."""
