"""Read the numbers of a run file, and check rising time and plausible sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MOST_FAULTS, Problem, few
from dbbstation.files.recordings.run_lines import fault_of_line
from dbbstation.trace import columns

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.recordings.run_lines import Lines


class Counted:
    """The first faults of a file, and their count."""

    def __init__(self) -> None:
        self.first: list[Problem] = []
        self.count = 0

    def add(self, problems: Iterable[Problem]) -> None:
        """Count faults and keep the first."""
        for problem in problems:
            self.count += 1
            if len(self.first) <= MOST_FAULTS:
                self.first.append(problem)

    @property
    def enough(self) -> bool:
        """Return whether further lines need not be read."""
        return self.count >= _MOST_COUNTED

    def told(self) -> list[Problem]:
        """Return the first faults, and how many follow."""
        return few(self.first, self.count)


_MOST_COUNTED = 10_000
"""Greatest number of counted faults; more add no information."""


class Numbers:
    """Numeric columns of a run file, 8 bytes a number."""

    def __init__(self) -> None:
        self.faults = Counted()
        self._parts: dict[str, list[Floats]] = {}
        self._last: Lines | None = None

    def take(self, lines: Lines) -> None:
        """Add the rows of a piece."""
        self._last = lines
        if not lines.rows:
            return
        numbers = _parsed(lines)
        if numbers is None:
            self.faults.add(_faults_of_lines(lines))
        elif not self.faults.count:
            for name, values in numbers.items():
                self._parts.setdefault(name, []).append(values)

    def columns(self) -> dict[str, Floats]:
        """Return every numeric column, shape (n,), and release the pieces; faults are added to `faults`."""
        last = self._last
        if self.faults.count or last is None:
            return {}
        if not self._parts:
            self.faults.add([Problem(last.file, last.header_line, 0, "there are no samples below this line")])
            return {}
        # One column after the other, so that no more than one stands twice in the memory.
        joined = {name: np.concatenate(self._parts.pop(name)) for name in list(self._parts)}
        count = len(joined[columns.TIME])
        numbers = (
            last.numbers if len(last.numbers) == count else range(last.header_line + 1, last.header_line + 1 + count)
        )
        self.faults.add(_faults_of_time(last.file, joined[columns.TIME], numbers))
        self.faults.add(_faults_of_size(last.file, joined, numbers))
        return joined


def _parsed(lines: Lines) -> dict[str, Floats] | None:
    if not lines.regular() or lines.bad_crc():
        return None
    names = [name for name in lines.columns if name in columns.COLUMNS]
    usecols = [lines.columns.index(name) for name in names]
    try:
        table = np.loadtxt(lines.rows, delimiter=",", usecols=usecols, comments=None, ndmin=2, encoding="latin-1")
    except ValueError:
        return None
    if len(table) != len(lines.rows) or not np.isfinite(table).all():
        return None
    return {name: table[:, i].copy() for i, name in enumerate(names)}


def _faults_of_lines(lines: Lines) -> Iterator[Problem]:
    found = False
    for number, row in zip(lines.numbers, lines.rows, strict=True):
        fault = fault_of_line(row, lines.columns)
        if fault is not None:
            found = True
            yield Problem(lines.file, number, 0, *fault)
    if not found:
        what = "NumPy reads this file otherwise than line by line"
        yield Problem(lines.file, 0, 0, what, "write plain decimal numbers")


def _faults_of_time(file: str, t_s: Floats, numbers: Sequence[int]) -> Iterator[Problem]:
    for index in (np.flatnonzero(t_s[1:] <= t_s[:-1]) + 1).tolist():
        what = "runs backwards" if t_s[index] < t_s[index - 1] else "stands still"
        what = f"time {what} here: t_s {t_s[index]:g} after {t_s[index - 1]:g}"
        remedy = "the file was reordered, or the clock was set while recording"
        yield Problem(file, numbers[index], 0, what, remedy)


def _faults_of_size(file: str, found: dict[str, Floats], numbers: Sequence[int]) -> Iterator[Problem]:
    for name, values in found.items():
        column = columns.COLUMNS[name]
        for index in np.flatnonzero((values > column.size) | (values < -column.size))[:1].tolist():
            what = f"{name} is {values[index]:g}, sizes up to {column.size:g} {column.unit} are plausible"
            remedy = f"check the unit, {column.unit} is needed"
            yield Problem(file, numbers[index], 0, what, remedy)
