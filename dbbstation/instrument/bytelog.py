"""The byte log: all bytes of a serial line with their times, as text that people can read and `replay` can decode.

    # dbb-byte-log/1
    # instrument: heidenhain-nd281b
    # port: /dev/ttyUSB0
           0.000000 > 02
           0.070721 < 2b 20 20 31 35 30 2e 30 30 30 33 20 20 20 20 0d 0a  | +  150.0003    ..

Times are in seconds since the log was opened: `>` went to the device, `<` came from it; the text behind the bar is for people.
"""

from __future__ import annotations

import math
import re
import time
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Literal

from dbbstation.errors import InputError, OutputError
from dbbstation.files.gateway import opened
from dbbstation.files.inputs import open_book
from dbbstation.files.source_text import lines_of, readable
from dbbstation.system.handles import Closing

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator
    from pathlib import Path

_HEAD = "# dbb-byte-log/1"
_LONGEST_S = 1e9
"""Greatest time in a line of the log [s]: thirty years."""
_LINE = re.compile(r"\s*([0-9]+(?:\.[0-9]*)?) ([<>]) ([0-9a-f]{2}(?: [0-9a-f]{2})*)(?:  \|.*)?")


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes that were on the line `t_s` seconds after the log was opened."""

    t_s: float
    direction: Literal["<", ">"]
    raw: bytes


class ByteLog(Closing):
    """A byte log being written.

    Args:
        path: must not exist.

    Raises:
        OutputError: the file exists, or cannot be written.
    """

    def __init__(
        self,
        path: Path,
        *,
        instrument: str,
        port: str,
        profile: str = "",
        force: bool = False,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        try:
            # Line buffered: after a crash everything but the last line stands in the file.
            self._file = path.open("w" if force else "x", encoding="utf-8", buffering=1, newline="\n")
        except FileExistsError:
            raise OutputError(
                "the byte log exists already", where=str(path), remedy="give another name or --force"
            ) from None
        except OSError as error:
            raise OutputError(f"cannot write the byte log: {error.strerror}", where=str(path)) from None
        self._path = path
        self._clock = clock
        self._opened_s = clock()
        variant = f"# profile: {profile}\n" if profile else ""
        self._file.write(f"{_HEAD}\n# instrument: {instrument}\n{variant}# port: {port}\n")

    def note(self, direction: Literal["<", ">"], raw: bytes) -> None:
        """Log bytes that went over the line.

        Raises:
            OutputError: the file cannot be written any more.
        """
        shown = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in raw)  # noqa: PLR2004 (printable ASCII)
        try:
            self._file.write(f"{self._clock() - self._opened_s:15.6f} {direction} {raw.hex(' ')}  | {shown}\n")
        except OSError as error:
            raise OutputError(f"cannot write the byte log: {error.strerror}", where=str(self._path)) from None

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def logged_instrument(path: Path) -> tuple[str, str]:
    """Return instrument and profile from a byte log's head; each may be empty.

    Raises:
        InputError: the file cannot be read or is no byte log.
    """
    told = {"# instrument": "", "# profile": ""}
    with closing(_lines(path)) as lines:
        for _, line in lines:
            if not line.startswith("#"):
                break
            key, _, value = line.partition(":")
            if key in told:
                told[key] = value.strip()
    return told["# instrument"], told["# profile"]


def read_byte_log(path: Path) -> Iterator[Chunk]:
    """Yield the chunks in time order; a last line that was cut off is left out.

    Raises:
        InputError: the file cannot be read, is no byte log, or has an invalid line.
    """
    for number, line in _lines(path):
        if line.startswith("#") or not line:
            continue
        match = _LINE.fullmatch(line)
        t_s = float(match[1]) if match is not None else math.inf
        if match is None or t_s > _LONGEST_S:
            remedy = "every line is: seconds, < or >, bytes in hexadecimal"
            raise InputError.of(path, "this line of the byte log cannot be read", remedy, line=number, column=1)
        direction: Literal["<", ">"] = "<" if match[2] == "<" else ">"
        yield Chunk(t_s, direction, bytes.fromhex(match[3]))


def _lines(path: Path) -> Generator[tuple[int, str]]:
    number = 0
    try:
        with readable(path), opened(path) as source:
            open_book().note_read(path)
            for number, (line, _) in enumerate(pairwise(lines_of(source.blocks())), start=1):
                if number > 1:
                    yield number, line.decode("utf-8").removesuffix("\r")
                elif line.strip() != _HEAD.encode():
                    break
            else:
                if number:
                    return
    except UnicodeDecodeError:
        raise InputError.of(path, "not a byte log: not UTF-8 text", line=number) from None
    raise InputError.of(path, f"not a byte log: the first line is not {_HEAD!r}", line=1, column=1)
