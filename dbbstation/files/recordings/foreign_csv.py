"""Read tables of other programs: title text, units below names, any separator, decimal commas, CRLF, byte order marks."""

from __future__ import annotations

import codecs
import re
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.files.csv_rows import csv_rows
from dbbstation.files.formats.number_language import NumberLanguage, is_number
from dbbstation.files.recordings.table_csv import TableFile, parse_table
from dbbstation.files.source_text import LARGEST_TABLE, decode, read_bytes, shortened, without_faults

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

_LANGUAGES = (
    NumberLanguage(".", ","),
    NumberLanguage(".", ";"),
    NumberLanguage(".", "\t"),
    NumberLanguage(",", ";"),
    NumberLanguage(",", "\t"),
)
"""Number formats of tables; of equally good ones, the first is used."""

_SIGNS = ",;\t"

_MINUS = "\N{MINUS SIGN}"
"""The minus sign that some programs write instead of a hyphen."""

_STATED = "so say the mapping, the options or the shop's settings: --decimal and --separator say otherwise"

_LOOKED_AT = 300
"""Number of first lines that determine the format and must contain the table's begin."""


_NAMES_WITHIN = 3
"""Number of lines above the first row that may contain the names of columns, since a line of units and an empty line
may follow them."""

_UNIT = re.compile(r"[\[(].*[\])]|[µμu]?m|mm|in|inch|mil|deg|°|rad|s|ms|min|°?c|degc|k|m?a|-", re.IGNORECASE)
"""Pattern of a cell with a unit."""


@dataclass(frozen=True, eq=False)
class ForeignTable:
    """A table of another program.

    Attributes:
        units: below the column names, by name; else empty.
        comments: `key: value` lines above the names, keys in small letters.
    """

    table: TableFile
    language: NumberLanguage
    units: Mapping[str, str]
    comments: Mapping[str, str]
    data: bytes
    comment_lines: Mapping[str, int] = field(default_factory=dict)
    repeated: tuple[int, ...] = ()


def read_foreign(path: Path, language: NumberLanguage | None = None, encoding: str | None = "utf-8") -> ForeignTable:
    """Read a table that another program wrote.

    Args:
        language: None: as fits best.
        encoding: without a byte order mark; None: as fits, in doubt refused.

    Raises:
        InputError: it cannot be read, has no table, or rows of different width.
    """
    data = without_faults(lambda faults: read_bytes(path, faults, LARGEST_TABLE))
    encoding = encoding or _encoding(data)
    if encoding not in _WIDE and (kind := kind_of(data)) is not None:
        raise InputError.of(path, *kind, 1, 1)
    text = _text(data, str(path), encoding)
    lines = _without_end(text.replace(_MINUS, "-").splitlines())
    chosen = language or _language(lines, str(path))
    lines = _without_last_separator(lines, chosen.separator)
    stated = "" if language is None else f"; {_STATED}"
    rows, first = _looked_at(lines, chosen, str(path))
    if first is None and (language is None or language.separator == "\t") and (parted := with_tabs(lines)) is not None:
        lines, chosen = parted, language or _language(parted, str(path))
        rows, first = _looked_at(lines, chosen, str(path))
    if first is None:
        raise InputError([_no_table(lines, chosen, str(path), stated)])
    above = [
        k for k in range(first) if len(rows[k]) == len(rows[first]) and any(rows[k]) and not _count(rows[k], chosen)
    ]
    near = [k for k in above if k >= first - _NAMES_WITHIN]
    if not near:
        what = "no line above the numbers names the columns"
        raise InputError.of(
            path, what, f"write one name per column in a line above the numbers{stated}", line=first + 1
        )
    # A line of units may stand below the names.
    has_units = len(near) > 1 and all(_UNIT.fullmatch(cell) for cell in rows[near[-1]] if cell)
    names = near[-2] if has_units else near[-1]
    body = [*[""] * names, lines[names].lstrip("\ufeff# "), *lines[names + 1 :]]
    if has_units:
        body[near[-1]] = ""
    if lines[names].rstrip(" ").endswith(chosen.separator) and not rows[names][-1]:
        body = [line.rstrip(" ").removesuffix(chosen.separator) for line in body]
    body, repeated = _heads_taken_out(body, names, chosen)
    table = parse_table("\n".join(body), str(path), numbers=chosen)
    units = dict(zip(table.names, rows[near[-1]], strict=False)) if has_units else {}
    comments = _comments(lines[:names])
    said = {key: text for key, (_, text) in comments.items()}
    return ForeignTable(table, chosen, units, said, data, {key: line for key, (line, _) in comments.items()}, repeated)


def _looked_at(lines: list[str], language: NumberLanguage, file: str) -> tuple[list[list[str]], int | None]:
    rows = [_cells(line, language, file, number) for number, line in enumerate(lines[:_LOOKED_AT], start=1)]
    return rows, next((k for k in range(len(rows)) if _is_row(rows[k], language) and _goes_on(rows, k, language)), None)


def _no_table(lines: list[str], language: NumberLanguage, file: str, stated: str) -> Problem:
    groups = [len(re.findall(r"\d+", line)) for line in lines[:_LOOKED_AT]]
    most = max(groups, default=0)
    if most < 2:  # noqa: PLR2004 - a row has two numbers
        what = "there is no table of numbers in this file"
        return Problem.of(file, what, f"check which file it is; {language.text}{stated}")
    line = groups.index(most) + 1
    what = (
        f"there is no table of numbers in this file; the line `{shortened(lines[line - 1].strip())}` is no row of one"
    )
    remedy = f"state --decimal and --separator, or check which file it is; the file was read with this assumption: {language.text}{stated}"
    return Problem.of(file, what, remedy, line, 1)


def _without_last_separator(lines: list[str], separator: str) -> list[str]:
    """Return lines without a final separator, if all of the widest lines have one."""
    widest = max((line.count(separator) for line in lines), default=0)
    wide = [line for line in lines if line.count(separator) == widest]
    if widest < 2 or not all(line.rstrip(" ").endswith(separator) for line in wide):  # noqa: PLR2004 - one ends the first cell
        return lines
    return [line.rstrip(" ").removesuffix(separator) if line.count(separator) == widest else line for line in lines]


def _heads_taken_out(body: list[str], names: int, language: NumberLanguage) -> tuple[list[str], tuple[int, ...]]:
    head = body[names].strip()
    again = [k for k in range(names + 1, len(body)) if body[k].strip() == head]
    kept = list(body)
    for k in again:
        kept[k] = ""
        above = k - 1
        # Titles stand right above the names: lines of one cell or two, such as `Run 2 CW` or `Date: 20.11.2026`.
        while above > names and not _is_row(_cells(body[above], language, "", above + 1), language):
            kept[above] = ""
            above -= 1
    return kept, tuple(k + 1 for k in again)


def _without_end(lines: list[str]) -> list[str]:
    last = next((k for k in range(len(lines) - 1, -1, -1) if lines[k].strip()), None)
    return lines if last is None or not re.fullmatch(r"\s*(END|EOF|ENDE)\s*", lines[last]) else lines[:last]


def _text(data: bytes, file: str, encoding: str) -> str:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    if encoding == "utf-8" or data.startswith(codecs.BOM_UTF8):
        found: list[Problem] = []
        if (text := decode(data, file, found)) is not None:
            return text
        remedy = (
            "say --encoding cp1252 where a western Windows program wrote it (cp1250 central European, cp1251 Cyrillic, cp932 Japanese, gb18030 "
            "Chinese), or save it as UTF-8"
        )
        raise InputError([replace(one, remedy=remedy) for one in found])
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        what = f"byte {data[error.start]:#04x} at position {error.start} is no {encoding} text"
        raise InputError.of(file, what, "give another --encoding, or save the file as UTF-8") from error


_WIDE = ("utf-16-be", "utf-16-le")
_RUN = re.compile(rb"[\x80-\xff]+")
_JAPANESE = re.compile(r"[\u3000-\u30ff\u4e00-\u9fff\uff01-\uff5e]+")
_WESTERN = 2
"""Greatest number of successive non-ASCII bytes in western words; Cyrillic and Asian words have more."""


def _encoding(data: bytes) -> str:
    """Return the only encoding that fits a text, else UTF-8; decoding then fails with a position."""
    zeros = data[::2].count(0), data[1::2].count(0)
    if max(zeros) > len(data) // 10:  # digits have one in two bytes
        return _WIDE[zeros[0] < zeros[1]]
    fits: dict[str, Callable[[str], object]] = {
        "utf-8": lambda _text: True,
        "cp1252": lambda _text: all(len(run) <= _WESTERN for run in _RUN.findall(data)),
        "cp932": lambda text: _JAPANESE.fullmatch("".join(letter for letter in text if not letter.isascii())),
    }
    for encoding, is_fit in fits.items():
        with suppress(UnicodeDecodeError):
            if is_fit(data.decode(encoding)):
                return encoding
    return "utf-8"


def _language(lines: list[str], file: str) -> NumberLanguage:
    def fit(language: NumberLanguage) -> int:
        rows = [_cells(line, language, file, k) for k, line in enumerate(lines[:_LOOKED_AT], start=1)]
        return sum(_count(row, language) - _whole(row, language) for row in rows if len(row) > 1)

    return max(_LANGUAGES, key=fit)


def _cells(line: str, language: NumberLanguage, file: str, number: int) -> list[str]:
    if not line.strip() or (line.lstrip("\ufeff ").startswith("#") and language.separator not in line):
        return []
    row = next(csv_rows([line], language.separator, file, first_line=number), (number, list[str]()))[1]
    return [cell.strip() for cell in row]


def _count(row: list[str], language: NumberLanguage) -> int:
    return sum(bool(np.isfinite(language.number(cell))) for cell in row)


def _whole(row: list[str], language: NumberLanguage) -> int:
    others = [cell for cell in row if any(sign in cell for sign in _SIGNS) and any(map(str.isdigit, cell))]
    return len(others) - _count(others, language)


def _is_row(row: list[str], language: NumberLanguage) -> bool:
    return _count(row, language) > 1


def _goes_on(rows: list[list[str]], k: int, language: NumberLanguage) -> bool:
    """Return whether the next line is also a row, because a single line of numbers may be a date."""
    following = next((row for row in rows[k + 1 :] if row), None)
    return following is not None and len(following) == len(rows[k]) and _is_row(following, language)


def _comments(lines: list[str]) -> dict[str, tuple[int, str]]:
    """Return line and text of `key: value`, `key = value` or `key;value` above the table."""
    found = {}
    for number, line in enumerate(lines, start=1):
        told = re.match(r"[\ufeff# ]*([^:=;\t,]{1,40}?)\s*[:=;\t,]\s*(.+)$", line)
        if told:
            found[told[1].strip().lower()] = (number, told[2].strip(' ";\t,'))
    return found


_AS_CSV = "save the sheet as CSV and name that"
_BEGINNINGS = (
    (b"PK\x03\x04", "this is an archive, as Excel and LibreOffice write their workbooks", _AS_CSV),
    (b"\xd0\xcf\x11\xe0", "this is an old Excel workbook or another file of several parts", _AS_CSV),
    (b"%PDF", "this is a PDF", "export the numbers as text from the program that made it"),
    (b"\x1f\x8b", "this file is compressed", "unpack it first"),
)
"""First bytes of files, the kind that they mean, and advice."""

_MARKUP = re.compile(rb"\s*<(\?xml|!doctype|html|[A-Za-z][\w:.-]*[\s/>])", re.IGNORECASE)

_LOOKED_AT_BYTES = 4_000
"""Number of first bytes that determine the kind of a file."""


def kind_of(data: bytes) -> tuple[str, str] | None:
    """Return kind and remedy of a file that is not a table, or None."""
    for beginning, what, remedy in _BEGINNINGS:
        if data.startswith(beginning):
            return what, remedy
    if _MARKUP.match(data[:_LOOKED_AT_BYTES].removeprefix(b"\xef\xbb\xbf")):
        what = "this is XML or HTML, no table; raw files of bar makers (.b5r) are not read either"
        return what, "export text from the program that made it, and map its columns (docs/import.md)"
    start = data[:_LOOKED_AT_BYTES]
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or not start:
        return None
    zeros = start.count(0)
    if zeros > len(start) // 3 and max(start[::2].count(0), start[1::2].count(0)) >= zeros - 1 and _is_utf_16(start):
        return (
            "every second byte is zero: this is UTF-16 text without a byte order mark",
            "save the file as UTF-8, or as UTF-16 with its mark",
        )
    return ("this is no text: it holds zero bytes", "export text from the program that made it") if zeros else None


def _is_utf_16(start: bytes) -> bool:
    even = start[: len(start) // 2 * 2]
    texts = [even.decode(one, errors="replace") for one in ("utf-16-le", "utf-16-be")]
    return any(sum(c.isprintable() or c.isspace() for c in text) > 0.95 * len(text) for text in texts)


def with_tabs(lines: list[str]) -> list[str] | None:
    """Return lines with tabs for the spaces between columns; None if the lines are no such table.

    Names may hold single spaces if two or more separate them.
    """
    parts = [line.split() for line in lines]
    numbers = [one for one in parts if one and all(map(_digits, one))]
    if len(numbers) < 2:  # noqa: PLR2004 - two rows
        numbers = [one for one in parts if len(one) > 2 and not _digits(one[0]) and all(map(_digits, one[1:]))]  # noqa: PLR2004 - a name first
    widths = [len(one) for one in numbers]
    if len(widths) < 2 or widths[0] < 2 or len(set(widths)) > 1:  # noqa: PLR2004 - two rows of two columns
        return None
    return [_parted(line, widths[0]) for line in lines]


def _digits(word: str) -> bool:
    return is_number(word.replace(",", "."))


def _parted(line: str, width: int) -> str:
    wide = re.split(r"\s{2,}", line.strip())
    narrow = line.split()
    cells = wide if len(wide) == width else narrow if len(narrow) == width else None
    return line if cells is None else "\t".join(cells)
