"""Lines of a run file: the header taken off, rows with their line numbers, checked one by one or all at once."""

from __future__ import annotations

import difflib
import math
import re
import zlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import Problem
from dbbstation.files.source_text import decode, first_line, shortened, unreadable
from dbbstation.trace import columns

if TYPE_CHECKING:
    from pathlib import Path

_COMMA, _NEWLINE = ord(","), ord("\n")
_CRC_LENGTH = 8
_NO_DIGIT = 255
_HEX_DIGIT = np.full(256, _NO_DIGIT, dtype=np.int64)
_HEX_DIGIT[np.frombuffer(b"0123456789abcdef", dtype=np.uint8)] = np.arange(16)
_HEX_PLACES = 16 ** np.arange(_CRC_LENGTH - 1, -1, -1, dtype=np.int64)
_CRC_TEXT = re.compile(rb"[0-9a-f]{8}")
_NUMBER = re.compile(rb"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Lines:
    """A run file taken apart into lines.

    Attributes:
        file: as named in messages.
        header: `# key: value` lines by key.
        header_line: number of the line that names the columns.
        columns: their names in order.
        rows: the lines below, without line ends.
        numbers: line number of each row.
        ended: the last row ends with a line end.
    """

    file: str
    header: dict[str, str]
    header_line: int
    columns: tuple[str, ...]
    rows: list[bytes]
    numbers: range | list[int]
    ended: bool

    @property
    def unknown(self) -> tuple[str, ...]:
        """Columns that this program does not know."""
        return tuple(name for name in self.columns if not columns.is_known(name))

    def keep(self, rows: slice) -> Lines:
        """Return the same file with only these rows."""
        return replace(self, rows=self.rows[rows], numbers=self.numbers[rows], ended=True)

    def texts(self, name: str) -> list[str]:
        """Return one column as text."""
        at = self.columns.index(name)
        return [row.split(b",")[at].decode("utf-8", "replace").strip() for row in self.rows]

    def regular(self) -> bool:
        """Whether every row has as many fields as there are columns."""
        text = np.frombuffer(b"\n".join(self.rows) + b"\n", dtype=np.uint8)
        separators = text[(text == _COMMA) | (text == _NEWLINE)]
        count = len(self.columns)
        if len(separators) != count * len(self.rows):
            return False
        table = separators.reshape(-1, count)
        return bool((table[:, -1] == _NEWLINE).all() and (table[:, :-1] == _COMMA).all())

    def bad_crc(self) -> bool:
        """Whether any row's checksum does not match it."""
        if columns.CRC not in self.columns:
            return False
        if min(map(len, self.rows), default=0) <= _CRC_LENGTH:
            return True
        text = np.frombuffer(b"\n".join(self.rows) + b"\n", dtype=np.uint8)
        ends = np.flatnonzero(text == _NEWLINE)
        digits = _HEX_DIGIT[text[ends[:, None] - np.arange(_CRC_LENGTH, 0, -1)]]
        if (text[ends - _CRC_LENGTH - 1] != _COMMA).any() or (digits == _NO_DIGIT).any():
            return True
        bodies = [row[: -_CRC_LENGTH - 1] for row in self.rows]
        found = np.fromiter(map(zlib.crc32, bodies), dtype=np.int64, count=len(bodies))
        return bool((found != digits @ _HEX_PLACES).any())


def lines_of(data: bytes, file: str, faults: list[Problem], warnings: list[Problem], *, partial: bool) -> Lines | None:
    """Lines of a run file that are to be read.

    Args:
        data: whole file.
        file: as named in messages.
        faults: what makes the file useless is added.
        warnings: what does not spoil it is added: unknown columns, a last line that was cut off, lines left out.
        partial: keep the good lines of an interrupted recording only.

    Returns:
        None where there are faults.
    """
    lines = split_file(data, file, faults)
    if lines is None or faults:
        return None
    for name in lines.unknown:
        what = f"the column `{name}` is not known; it is kept and not used"
        warnings.append(Problem(file, lines.header_line, 0, what))
    lines = _without_cut_line(lines, warnings)
    if partial:
        lines, bad = good_lines(lines)
        warnings += bad
    return lines


def split_file(data: bytes, file: str, faults: list[Problem]) -> Lines | None:
    """Take a run file apart; None, or columns that cannot be used, are told in `faults`."""
    all_lines = data.replace(b"\r\n", b"\n").split(b"\n")
    ended = all_lines[-1] == b""
    if ended:
        all_lines.pop()
    header: dict[str, str] = {}
    at = 0
    while at < len(all_lines) and (all_lines[at].startswith((b"#", b"\xef\xbb\xbf#")) or not all_lines[at].strip()):
        header |= _said(all_lines[at])
        at += 1
    if at == len(all_lines):
        what = "the file is empty" if not data.strip() else "there is no line that names the columns"
        faults.append(Problem(file, at, 0, what, f"a run starts with the line `{','.join(columns.REQUIRED)}`"))
        return None
    bad: list[Problem] = []
    text = decode(all_lines[at], file, bad)
    if text is None:
        faults.extend(replace(problem, line=at + 1) for problem in bad)
        return None
    names = tuple(name.strip() for name in text.split(","))
    _check_columns(names, file, at + 1, faults)
    rows = all_lines[at + 1 :]
    while rows and rows[-1].startswith(b"#"):
        header |= _said(rows.pop())
    return Lines(file, header, at + 1, names, rows, range(at + 2, at + 2 + len(rows)), ended)


def split_head(path: Path, faults: list[Problem]) -> tuple[str, ...]:
    """Return the columns of a run file without reading its samples; none, with the reason in `faults`, where it has none."""
    try:
        head = first_line(path)
    except OSError as error:
        faults.append(unreadable(path, error))
        return ()
    text = decode(head, str(path), faults)
    return () if not text else tuple(name.strip() for name in text.split(","))


def _said(line: bytes) -> dict[str, str]:
    """What a line `# key: value` above or below the samples says."""
    key, colon, value = line.decode("utf-8", "replace").lstrip("\ufeff#").partition(":")
    return {key.strip(): value.strip()} if colon else {}


def _check_columns(names: tuple[str, ...], file: str, line: int, faults: list[Problem]) -> None:
    unknown = [name for name in names if not columns.is_known(name)]
    for missing in (name for name in columns.REQUIRED if name not in names):
        near = difflib.get_close_matches(missing, unknown, n=1, cutoff=0.5)
        remedy = f"is it `{near[0]}`?" if near else f"columns here: {', '.join(names)}"
        unit = columns.COLUMNS[missing].unit
        faults.append(Problem(file, line, 0, f"the column `{missing}` [{unit}] is missing", remedy))
    faults.extend(
        Problem(file, line, 0, f"the column `{name}` stands here more than once", "remove one")
        for name in sorted({name for name in names if names.count(name) > 1})
    )
    if columns.CRC in names and names[-1] != columns.CRC:
        faults.append(Problem(file, line, 0, "the column `crc` must be the last", "it covers all others"))


def _without_cut_line(lines: Lines, warnings: list[Problem]) -> Lines:
    """Drop a last line that does not end: its last digits may be missing without a trace. Its CRC can vouch for it."""
    if lines.ended or not lines.rows:
        return lines
    number, last = lines.numbers[-1], lines.rows[-1]
    if columns.CRC in lines.columns and fault_of_line(last, lines.columns) is None:
        return lines
    warnings.append(Problem(lines.file, number, 0, "the last line was cut off; it is left out"))
    return lines.keep(slice(0, -1))


def fault_of_line(row: bytes, names: tuple[str, ...]) -> tuple[str, str] | None:
    """What is wrong with one row and what to do, None where nothing is."""
    if not row.strip():
        return "an empty line between samples", "remove it"
    fields = row.split(b",")
    if names[-1] == columns.CRC:
        body, _, stated = row.rpartition(b",")
        if not _CRC_TEXT.fullmatch(stated):
            return "the line has no checksum of eight hex digits", "the line was damaged, restore the file"
        if int(stated, 16) != zlib.crc32(body):
            return "the checksum does not match the line", "the line was damaged, restore the file"
    if len(fields) != len(names):
        return (
            f"{len(fields)} values in {len(names)} columns",
            "compare the line with the header; the decimal sign is a dot",
        )
    return _fault_of_fields(fields, names)


def _fault_of_fields(fields: list[bytes], names: tuple[str, ...]) -> tuple[str, str] | None:
    for name, text in zip(names, fields, strict=True):
        if name not in columns.COLUMNS:
            continue
        shown = shortened(text.decode("utf-8", "replace").strip())
        if not _NUMBER.fullmatch(text.strip()):
            kind = "not a finite number" if shown.lower().lstrip("+-") in {"nan", "inf", "infinity"} else "no number"
            return f"{name} is `{shown}`, {kind}", "write digits with a dot as decimal sign, leave no value out"
        if not math.isfinite(float(text)):
            return f"{name} is `{shown}`, beyond any number", "check the line"
    return None


def good_lines(lines: Lines) -> tuple[Lines, list[Problem]]:
    """Rows of an interrupted recording that can be trusted, in time order, and what is wrong with the others.

    After a power cut pages of a file come back empty, stale or in another order. Only the checksum of each line tells
    good rows from bad ones; without one every row that reads well counts, as far as time rises.
    """
    kept: list[tuple[bytes, int]] = []
    problems: list[Problem] = []
    for number, row in zip(lines.numbers, lines.rows, strict=True):
        # Zeroed pages stand between lines without a line end of their own.
        for piece in row.split(b"\0"):
            if not piece.strip():
                continue
            fault = fault_of_line(piece, lines.columns)
            if fault is None:
                kept.append((piece, number))
            else:
                problems.append(Problem(lines.file, number, 0, f"{fault[0]}; it is left out"))
    return _in_time_order(lines, kept, problems), problems


def _in_time_order(lines: Lines, kept: list[tuple[bytes, int]], problems: list[Problem]) -> Lines:
    at = lines.columns.index(columns.TIME)
    times = [float(row.split(b",")[at]) for row, _ in kept]
    order = sorted(range(len(kept)), key=times.__getitem__)
    moved = order != list(range(len(kept)))
    if moved and columns.CRC not in lines.columns:
        # Nothing vouches for what stands after a step back in time.
        end = next(i for i in range(1, len(times)) if times[i] < times[i - 1])
        what = (
            f"time runs backwards here: t_s {times[end]:g} after {times[end - 1]:g}; the lines from here are left out"
        )
        problems.append(Problem(lines.file, kept[end][1], 0, what))
        order = list(range(end))
    elif moved:
        problems.append(Problem(lines.file, 0, 0, "lines were found out of order; they are sorted by time"))
    chosen: list[int] = []
    for index in order:
        if not chosen or times[index] > times[chosen[-1]]:
            chosen.append(index)
        elif kept[index][0] != kept[chosen[-1]][0]:
            what = f"time stands still here: t_s {times[index]:g}; it is left out"
            problems.append(Problem(lines.file, kept[index][1], 0, what))
    return replace(lines, rows=[kept[i][0] for i in chosen], numbers=[kept[i][1] for i in chosen], ended=True)
