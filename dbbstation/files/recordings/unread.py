"""Recognise files that are not tables, and columns separated by spaces."""

from __future__ import annotations

import re

from dbbstation.files.formats.number_language import is_number

_BEGINNINGS = (
    (
        b"PK\x03\x04",
        "this is an archive, as Excel and LibreOffice write their workbooks",
        "save the sheet as CSV and name that",
    ),
    (
        b"\xd0\xcf\x11\xe0",
        "this is an old Excel workbook or another file of several parts",
        "save the sheet as CSV and name that",
    ),
    (b"%PDF", "this is a PDF", "export the numbers as text from the program that made it"),
    (b"\x1f\x8b", "this file is compressed", "unpack it first"),
)
"""First bytes of files, the kind that they mean, and advice."""

_MARKUP = re.compile(rb"\s*<(\?xml|!doctype|html|[A-Za-z][\w:.-]*[\s/>])", re.IGNORECASE)

_LOOKED_AT = 4_000
"""Number of first bytes that determine the kind of a file."""


def kind_of(data: bytes) -> tuple[str, str] | None:
    """Return kind and remedy of a file that is not a table, or None."""
    for beginning, what, remedy in _BEGINNINGS:
        if data.startswith(beginning):
            return what, remedy
    if _MARKUP.match(data[:_LOOKED_AT].removeprefix(b"\xef\xbb\xbf")):
        what = "this is XML or HTML, no table; raw files of bar makers (.b5r) are not read either"
        return what, "export text from the program that made it, and map its columns (docs/import.md)"
    start = data[:_LOOKED_AT]
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
