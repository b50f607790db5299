"""Read CSV rows cell by cell, and write them safely for spreadsheets."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.formats.number_language import is_number
from dbbstation.text.written import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence


_BEGINS_FORMULA = frozenset("=+-@\t\n＝＋－＠")
"""Characters that begin a formula in a spreadsheet, or that it ignores before one [OWASP, CSV Injection]."""

DIGITS = 12
"""Digits of a written number. Rounding errors of sums begin at the sixteenth digit; a micrometre in a kilometre is the ninth."""

_NONE = "-"
"""Cells that mean a missing value."""


def csv_text(rows: Iterable[Iterable[object]], *, exact: bool = False) -> str:
    """Return rows as CSV text for spreadsheets, numbers with `DIGITS` digits.

    A text that resembles a formula gets `'` before it.

    Args:
        exact: write as many digits as read back the same bits.
    """
    out = io.StringIO(newline="")
    csv.writer(out, lineterminator="\n").writerows((_guarded(cell, exact=exact) for cell in row) for row in rows)
    return out.getvalue()


def table_csv(names: Sequence[str], columns: Sequence[Sequence[object]]) -> str:
    """Return columns as CSV text; numbers with nine significant digits."""
    rows = ([f"{cell:.9g}" if isinstance(cell, float) else cell for cell in row] for row in zip(*columns, strict=True))
    return csv_text([names, *rows])


def _guarded(cell: object, *, exact: bool) -> object:
    if isinstance(cell, float):
        return cell if exact else float(f"{cell:.{DIGITS}g}")
    if not isinstance(cell, str):
        return cell
    shown = printable(cell)  # a carriage return would begin a row, and a formula at its start a cell
    if shown.lstrip(" ")[:1] not in _BEGINS_FORMULA or shown == _NONE or is_number(shown):
        return shown
    return f"'{shown}"


def csv_rows(
    lines: Iterable[str], separator: str, file: str, *, first_line: int = 1, skip_spaces: bool = False
) -> Iterator[tuple[int, list[str]]]:
    """Yield the line number and the cells of each row.

    Raises:
        InputError: a cell is too long, for example after an unclosed quotation mark.
    """
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=skip_spaces)
    try:
        for cells in reader:
            yield first_line - 1 + reader.line_num, cells
    except csv.Error as error:
        what = f"a cell has more than {csv.field_size_limit():,} characters"
        line = first_line - 1 + reader.line_num
        raise InputError.of(file, what, "check its quotation marks, or name another file", line=line) from error


def csv_cells(line: str, separator: str, file: str, number: int) -> list[str]:
    """Return the cells of one line with a number in its file; raises as `csv_rows`."""
    if '"' in line or len(line) > csv.field_size_limit():
        return next(csv_rows([line], separator, file, first_line=number))[1]
    return line.split(separator)  # several times as fast
