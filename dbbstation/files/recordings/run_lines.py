"""Read lines of a run file in pieces, remove the header and check the rows."""

from __future__ import annotations

import math
import re
import zlib
from dataclasses import dataclass, replace
from sys import intern
from typing import TYPE_CHECKING

from dbbstation.catalogue import meant
from dbbstation.files.formats.number_language import NUMBER
from dbbstation.files.source_text import LONGEST_LINE, decode, first_line, readable, shortened, without_faults
from dbbstation.trace import columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dbbstation.errors import Faults, Problem

_CRC_TEXT = re.compile(rb"[0-9a-f]{8}")
_NUMBER = re.compile(NUMBER.encode())


@dataclass(frozen=True)
class Lines:
    """A run file, or a part of it, as lines.

    Attributes:
        header: `# key: value` lines read so far, by key.
        columns: in order.
        rows: without line ends.
        ended: whether the last row ends with a line end.
    """

    header: dict[str, str]
    header_line: int
    columns: tuple[str, ...]
    rows: list[bytes]
    numbers: range | list[int]
    ended: bool
    opening: bool = True

    @property
    def unknown(self) -> tuple[str, ...]:
        """Return columns unknown to this program."""
        return tuple(name for name in self.columns if not columns.is_known(name))

    def keep(self, rows: slice) -> Lines:
        """Return the lines with only these rows."""
        return replace(self, rows=self.rows[rows], numbers=self.numbers[rows], ended=True)

    def texts(self, name: str) -> list[str]:
        """Return one column as text; equal texts are stored once."""
        at = self.columns.index(name)
        return [intern(row.split(b",")[at].decode("utf-8", "replace").strip()) for row in self.rows]

    def regular(self) -> bool:
        """Return whether every row has as many fields as columns."""
        commas = len(self.columns) - 1
        return all(row.count(b",") == commas for row in self.rows)

    def bad_crc(self) -> bool:
        """Return whether any row's checksum is wrong."""
        return columns.CRC in self.columns and any(row[-9:] != b",%08x" % zlib.crc32(row[:-9]) for row in self.rows)


def pieces_of(blocks: Iterable[bytes], faults: Faults, warnings: Faults, *, partial: bool) -> Iterator[Lines]:
    """Yield a run file's usable lines in pieces, up to the first fault.

    Args:
        faults: grows by what makes the file useless.
        warnings: grows by unknown columns, a cut last line, lines left out.
        partial: yield only the good lines of an interrupted recording, in one piece: they may be out of order.
    """
    pieces = split_pieces(blocks, faults)
    if partial:
        whole = _whole(pieces)
        pieces = iter([] if whole is None else [whole])
    for piece in pieces:
        if piece.opening:
            _check_columns(piece.columns, piece.header_line, faults)
            for name in piece.unknown:
                what = f"the column `{shortened(name)}` is not known; it is kept and not used"
                warnings.add(what, line=piece.header_line)
        if faults:
            return
        lines = _without_cut_line(piece, warnings)
        if partial:
            lines = _good_lines(lines, warnings)
        yield lines


def _whole(pieces: Iterable[Lines]) -> Lines | None:
    every = list(pieces)
    if not every:
        return None
    rows = [row for piece in every for row in piece.rows]
    start = every[0].header_line + 1
    return replace(every[0], rows=rows, numbers=range(start, start + len(rows)), ended=every[-1].ended)


def split_pieces(blocks: Iterable[bytes], faults: Faults) -> Iterator[Lines]:
    """Split a run file into pieces. A file without header has no piece and a reason in `faults`.

    All pieces share one header, complete after the last piece.
    """
    header: dict[str, str] = {}
    top: Lines | None = None
    above, blank = 0, True
    foot: list[bytes] = []  # it is one if no row follows
    for lines, ended in _lines(blocks, faults):
        if top is None:
            at = next((at for at, line in enumerate(lines) if _names_columns(line)), len(lines))
            for line in lines[:at]:
                header |= _said(line)
                blank = blank and not line.strip()
            above += at
            if at == len(lines):
                continue
            names = _names(lines[at], above + 1, faults)
            if names is None:
                return
            top = Lines(header, above + 1, names, [], range(0), ended)
            above += 1
            lines = lines[at + 1 :]  # noqa: PLW2901 (the rest of them)
        rows = [*foot, *lines]
        end = len(rows)
        while end and rows[end - 1].startswith(b"#") and len(rows) - end < _LONGEST_FOOT:
            end -= 1
        foot = rows[end:]
        cut = not ended and not foot
        yield replace(top, rows=rows[:end], numbers=range(above + 1, above + 1 + end), ended=not cut)
        top = replace(top, opening=False)
        above += end
    if top is None and not faults:
        what = "there is no line that names the columns" if above and not blank else "the file is empty"
        faults.add(what, f"a run starts with the line `{','.join(columns.REQUIRED)}`", above)
    for line in foot:
        header |= _said(line)


_LONGEST_FOOT = 1000
"""Greatest number of lines `# key: value` below the rows; the program writes ten."""


def _lines(blocks: Iterable[bytes], faults: Faults) -> Iterator[tuple[list[bytes], bool]]:
    """Yield the lines of each block and whether they end with a line end; only the file's last line may lack it."""
    left = b""
    number = 1
    for block in blocks:
        text = left + block
        end = text.rfind(b"\n") + 1
        left = text[end:]
        if end:
            lines = text[:end].replace(b"\r\n", b"\n")[:-1].split(b"\n")
            number += len(lines)
            yield lines, True
        if len(left) > LONGEST_LINE:
            faults.add(f"the line has more than {LONGEST_LINE:,} characters", "check which file it is", number)
            return
    if left:
        yield [left], False


def _names_columns(line: bytes) -> bool:
    return bool(line.strip()) and not line.startswith((b"#", b"\xef\xbb\xbf#"))


def _names(line: bytes, number: int, faults: Faults) -> tuple[str, ...] | None:
    bad: list[Problem] = []
    text = decode(line, faults.file, bad)
    faults.extend(replace(problem, line=number) for problem in bad)
    return None if text is None else tuple(name.strip() for name in text.split(","))


def split_head(path: Path) -> tuple[str, ...]:
    """Return a run file's columns without reading samples; none without a header.

    Raises:
        InputError: the file cannot be read.
    """
    with readable(path):
        head = first_line(path)
    text = without_faults(decode, head, str(path))
    return tuple(name.strip() for name in text.split(",")) if text else ()


def _said(line: bytes) -> dict[str, str]:
    key, colon, value = line.decode("utf-8", "replace").lstrip("\ufeff#").partition(":")
    return {key.strip(): value.strip()} if colon else {}


def _check_columns(names: tuple[str, ...], line: int, faults: Faults) -> None:
    unknown = [name for name in names if not columns.is_known(name)]
    for missing in (name for name in columns.REQUIRED if name not in names):
        remedy = meant(missing, unknown, f"columns here: {', '.join(names)}", "is it `{}`?", 0.5)
        unit = columns.COLUMNS[missing].unit
        faults.add(f"the column `{missing}` [{unit}] is missing", remedy, line)
    for name in sorted({name for name in names if names.count(name) > 1}):
        faults.add(f"the column `{name}` appears here more than once", "remove one", line)
    if columns.CRC in names and names[-1] != columns.CRC:
        faults.add("the column `crc` must be the last", "it covers all others", line)


def _without_cut_line(lines: Lines, warnings: Faults) -> Lines:
    """Drop a last line without line end unless its CRC is right, because digits may be missing."""
    if lines.ended or not lines.rows:
        return lines
    if columns.CRC in lines.columns and fault_of_line(lines.rows[-1], lines.columns) is None:
        return lines
    warnings.add("the last line was cut off; it is left out", line=lines.numbers[-1])
    return lines.keep(slice(0, -1))


def fault_of_line(row: bytes, names: tuple[str, ...]) -> tuple[str, str] | None:
    """Return fault and remedy of a row, or None."""
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


def _good_lines(lines: Lines, warnings: Faults) -> Lines:
    """Return trusted rows of an interrupted recording in time order, and warn of the others.

    After a power cut, pages may be empty, old or reordered. The checksum decides; without one, readable rows with
    rising time are trusted.
    """
    kept: list[tuple[bytes, int]] = []
    for number, row in zip(lines.numbers, lines.rows, strict=True):
        # Zeroed pages stand between lines without a line end of their own.
        for piece in row.split(b"\0"):
            if not piece.strip():
                continue
            fault = fault_of_line(piece, lines.columns)
            if fault is None:
                kept.append((piece, number))
            else:
                warnings.add(f"{fault[0]}; it is left out", line=number)
    return _in_time_order(lines, kept, warnings)


def _in_time_order(lines: Lines, kept: list[tuple[bytes, int]], warnings: Faults) -> Lines:
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
        warnings.add(what, line=kept[end][1])
        order = list(range(end))
    elif moved:
        warnings.add("lines were found out of order; they are sorted by time")
    chosen: list[int] = []
    for index in order:
        if not chosen or times[index] > times[chosen[-1]]:
            chosen.append(index)
        elif kept[index][0] != kept[chosen[-1]][0]:
            warnings.add(f"time stands still here: t_s {times[index]:g}; it is left out", line=kept[index][1])
    return replace(lines, rows=[kept[i][0] for i in chosen], numbers=[kept[i][1] for i in chosen], ended=True)
