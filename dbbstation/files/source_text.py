"""Reading a text file whole, with every reason why that may fail said as a `Problem`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import Problem
from dbbstation.files.inputs import note_input

if TYPE_CHECKING:
    from pathlib import Path


def read_bytes(path: Path, faults: list[Problem], *, is_input: bool = True) -> bytes | None:
    """Return a file's bytes, or None with the reason added to `faults`.

    Args:
        path: of the file.
        faults: take the reason.
        is_input: outputs name it among their inputs; not so where the hash of the file stands in another input.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        faults.append(Problem(str(path), 0, 0, "there is no such file", "check the path"))
    except IsADirectoryError:
        faults.append(Problem(str(path), 0, 0, "this is a folder, a file is needed", "name the file in it"))
    except OSError as error:
        why = (error.strerror or "unknown reason").lower()
        faults.append(Problem(str(path), 0, 0, f"cannot be read: {why}", "check its permissions and the disk"))
    else:
        if is_input:
            note_input(path, data)
        return data
    return None


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
