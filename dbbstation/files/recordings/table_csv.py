"""Read tables of any columns: CSV with a header line, and commas, semicolons or tabs; `#` begins a comment."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from datetime import datetime
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from dbbstation.catalogue import meant
from dbbstation.errors import MOST_FAULTS, Faults, InputError, Problem, refuse
from dbbstation.files.csv_rows import csv_cells
from dbbstation.files.formats.number_language import PLAIN, SEPARATORS, NumberLanguage
from dbbstation.files.source_text import LARGEST_TABLE, numbered_lines, shortened, text_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Floats, Integers

OF_SHEETS = frozenset({"#n/a", "#nv", "#div/0!", "#value!", "#wert!", "#num!", "#zahl!", "#ref!", "#bezug!"})
"""Cells that a spreadsheet could not compute, in small letters."""

NO_NUMBER = frozenset({"", "nan", "na", "n/a", "null", "none", "-"}) | OF_SHEETS
"""Cells that mean a missing number, in small letters."""

_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")
"""A number with a decimal comma."""

_WHOLE = re.compile(r"[+-]?\d+")


@dataclass(frozen=True, eq=False)
class TableFile:
    """A table from one file.

    Attributes:
        names: in order.
        lines: number of each row's line, shape (n,).
        cells: texts by column, n each, with a decimal point.
        values: numbers by column, shape (n,); NaN for empty cells and texts.
        instants: columns of dates and times; their numbers are seconds after the first.
    """

    file: str
    header: int
    names: tuple[str, ...]
    lines: Integers
    cells: dict[str, tuple[str, ...]]
    values: dict[str, Floats] = field(default_factory=dict)
    instants: frozenset[str] = frozenset()

    def __len__(self) -> int:
        return len(self.lines)

    def faults_of(self, name: str) -> list[Problem]:
        """Return a column's cells that are neither numbers nor empty, with their lines."""
        if np.isfinite(self.values[name]).all():
            return []
        comma = next((cell for cell in self.cells[name] if _COMMA.fullmatch(cell)), None)
        if comma is not None and all(
            _COMMA.fullmatch(cell) or _WHOLE.fullmatch(cell) or cell.lower() in NO_NUMBER for cell in self.cells[name]
        ):
            what = f"{name} has decimal commas, such as `{shortened(comma)}`"
            return [Problem.of(self.file, what, "state the decimal sign: `--decimal ,`", self.header)]
        return [*self.not_finite(name, "correct the cell, or leave it empty", NO_NUMBER)]

    def not_finite(self, name: str, remedy: str, but: Collection[str] = ()) -> Iterator[Problem]:
        """Return a fault of each cell of a column without a finite number, except for some in small letters."""
        for k in np.flatnonzero(~np.isfinite(self.values[name])).tolist():
            if (cell := self.cells[name][k]).lower() not in but:
                what = f"{name} is `{shortened(cell)}`, not a finite number"
                yield Problem(self.file, int(self.lines[k]), 0, what, remedy)

    def is_text(self, name: str) -> bool:
        """Return whether a column has no number."""
        return not np.isfinite(self.values[name]).any()


def read_table(path: Path, needed: Iterable[str] = (), numbers: NumberLanguage | None = None) -> TableFile:
    """Read a table.

    Args:
        numbers: None: decimal point and the header's most frequent separator.

    Raises:
        InputError: it cannot be read, has no rows, lacks a column (with likely ones), or rows of different width.
    """
    return parse_table(text_of(path, LARGEST_TABLE), str(path), needed, numbers)


def parse_table(text: str, file: str, needed: Iterable[str] = (), numbers: NumberLanguage | None = None) -> TableFile:
    """Parse the text of a table.

    Raises:
        InputError: as `read_table`.
    """
    lines = numbered_lines(text)
    if not lines:
        raise InputError.of(file, "the file has no columns and no rows", "begin with a line of names")
    header, head = lines[0]
    language = numbers or NumberLanguage(separator=max(SEPARATORS, key=head.count))
    names = [name.strip() for name in csv_cells(head, language.separator, file, header)]
    faults = _faults_of_names(names, needed, file, header, language)
    if not faults and len(lines) == 1:
        faults.add("there are no rows below this line", line=header)
    rows, places = [], []
    for number, line in lines[1:]:
        cells = [cell.strip() for cell in csv_cells(line, language.separator, file, number)]
        if len(cells) != len(names):
            what = f"{len(cells)} values in {len(names)} columns"
            faults.add(what, f"compare the line with the header; {language.text}", number)
            continue
        rows.append(cells)
        places.append(number)
    refuse(faults[:MOST_FAULTS])
    columns = {name: tuple(row[k] for row in rows) for k, name in enumerate(names)}
    values = {name: _numbers(column, language) for name, column in columns.items()}
    if language.decimal != PLAIN.decimal:
        columns = {name: _plain(column, values[name], language) for name, column in columns.items()}
    texts = [name for name in names if not np.isfinite(values[name]).any()]
    instants = {name: at for name in texts if (at := _seconds(columns[name])) is not None}
    places_of = np.array(places, dtype=np.int64)
    return TableFile(file, header, tuple(names), places_of, columns, values | instants, frozenset(instants))


class AnyFrame(Protocol):
    """A DataFrame of any library."""

    @property
    def columns(self) -> Any:  # noqa: ANN401 - each library has its own
        """Return the names."""

    def __getitem__(self, name: Any, /) -> Any:  # noqa: ANN401 - the same
        """Return a column."""


if TYPE_CHECKING:
    Columns = Mapping[str, Any] | AnyFrame | NDArray[Any]
    """Columns in memory: arrays by name, a DataFrame, or an array with named fields."""


def given_table(given: Columns, needed: Iterable[str] = (), file: str = "table") -> TableFile:
    """Return columns in memory as a table; times become seconds after the first, rows count from 1.

    Raises:
        InputError: no rows, a missing column, or columns of several lengths or dimensions.
    """
    names: Any = given.dtype.names or () if isinstance(given, np.ndarray) else getattr(given, "columns", given)
    arrays = {str(name): np.asarray(given[name]) for name in names}
    length = max((len(one) for one in arrays.values() if one.ndim), default=0)
    faults = _faults_of_names(list(arrays), needed, file, 0)
    faults += [
        Problem.of(file, f"`{name}` has the shape {one.shape}, not ({length},)", "give columns of equal length")
        for name, one in arrays.items()
        if one.shape != (length,)
    ]
    if faults or not length:
        raise InputError(faults[:MOST_FAULTS] or [Problem.of(file, "there are no rows")])
    instants = frozenset(name for name, one in arrays.items() if one.dtype.kind in "mM")
    arrays |= {name: (arrays[name] - arrays[name][0]) / np.timedelta64(1, "s") for name in instants}
    cells = {
        name: tuple("" if value is None or value != value else str(value) for value in one.tolist())  # noqa: PLR0124 - NaN
        for name, one in arrays.items()
    }
    values = {
        name: one.astype(float) if one.dtype.kind in "biuf" else _numbers(cells[name], PLAIN)
        for name, one in arrays.items()
    }
    return TableFile(file, 0, tuple(arrays), np.arange(1, length + 1), cells, values, instants)


def _seconds(cells: Sequence[str]) -> Floats | None:
    """Return dates and times [ISO 8601] as seconds after the first; NaN if empty, None if any cell has another text."""
    try:
        at = [None if cell.lower() in NO_NUMBER else datetime.fromisoformat(cell) for cell in cells]
        first = next(one for one in at if one is not None)
        return np.array([np.nan if one is None else (one - first).total_seconds() for one in at])
    except (ValueError, TypeError, StopIteration):  # some with a time zone and some without differ by nothing known
        return None


def missing_column(name: str, names: Sequence[str], file: str, line: int, language: NumberLanguage = PLAIN) -> Problem:
    """Return the fault of a missing column, and name likely columns, or the separator if the names contain another."""
    others = [sign for sign in SEPARATORS if sign != language.separator and any(sign in each for each in names)]
    shown = language.text if others else f"columns here: {', '.join(names)}"
    remedy = meant(name, names, shown, likeness=0.5)
    return Problem(file, line, 0, f"there is no column `{name}`", remedy)


def _faults_of_names(
    names: list[str], needed: Iterable[str], file: str, line: int, language: NumberLanguage = PLAIN
) -> Faults:
    faults = Faults(file)
    for name, times in sorted(Counter(filter(None, names)).items()):
        if times > 1:
            faults.add(f"the column `{name}` appears here more than once", "rename one", line)
    if "" in names:
        faults.add(f"column {names.index('') + 1} has no name", "name it", line)
    there = set(names)
    faults += [missing_column(name, names, file, line, language) for name in dict.fromkeys(needed) if name not in there]
    return faults


def _plain(cells: Sequence[str], values: Floats, language: NumberLanguage) -> tuple[str, ...]:
    return tuple(
        cell.replace(language.decimal, PLAIN.decimal) if np.isfinite(value) else cell
        for cell, value in zip(cells, values, strict=True)
    )


def _numbers(cells: Sequence[str], language: NumberLanguage) -> Floats:
    plain: Sequence[str] = cells
    if language.decimal != PLAIN.decimal and not any(PLAIN.decimal in cell for cell in cells):
        plain = [cell.replace(language.decimal, PLAIN.decimal) for cell in cells]
    written = "".join(plain)
    if (language.decimal == PLAIN.decimal or plain is not cells) and written.isascii() and "_" not in written:
        try:
            return np.array(plain, dtype=np.float64)
        except ValueError:
            pass  # a cell without a number, or with another sign: one by one
    return np.array([language.number(cell) for cell in cells])
