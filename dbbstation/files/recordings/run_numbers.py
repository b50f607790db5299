"""Numbers of a run file: lines to columns, time that rises, sizes that are plausible.

Whole files are parsed by NumPy at once; line by line only to name what is wrong with a file that it refused.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import Problem
from dbbstation.files.recordings.run_lines import fault_of_line
from dbbstation.trace import columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.files.recordings.run_lines import Lines


def numbers_of(lines: Lines, faults: list[Problem]) -> dict[str, NDArray[np.float64]] | None:
    """Every numeric column, shape (n,); None where something is wrong, with every fault added to `faults`."""
    if not lines.rows:
        faults.append(Problem(lines.file, lines.header_line, 0, "there are no samples below this line"))
        return None
    numbers = _parsed(lines)
    if numbers is None:
        faults += _faults_of_lines(lines)
        return None
    wrong = [*_faults_of_time(lines, numbers[columns.TIME]), *_faults_of_size(lines, numbers)]
    faults += wrong
    return None if wrong else numbers


def _parsed(lines: Lines) -> dict[str, NDArray[np.float64]] | None:
    """Parse all lines at once; None where one of them is not as it should be."""
    if not lines.regular() or lines.bad_crc():
        return None
    names = [name for name in lines.columns if name in columns.COLUMNS]
    usecols = [lines.columns.index(name) for name in names]
    text = io.BytesIO(b"\n".join(lines.rows))
    try:
        table = np.loadtxt(text, delimiter=",", usecols=usecols, comments=None, ndmin=2, encoding="latin-1")
    except ValueError:
        return None
    if len(table) != len(lines.rows) or not np.isfinite(table).all():
        return None
    return {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)}


def _faults_of_lines(lines: Lines) -> list[Problem]:
    faults = [
        Problem(lines.file, number, 0, *fault)
        for number, row in zip(lines.numbers, lines.rows, strict=True)
        if (fault := fault_of_line(row, lines.columns)) is not None
    ]
    what = "NumPy reads this file otherwise than line by line"
    return faults or [Problem(lines.file, 0, 0, what, "write plain decimal numbers")]


def _faults_of_time(lines: Lines, t_s: NDArray[np.float64]) -> list[Problem]:
    """Places where time does not rise."""
    faults = []
    for index in np.flatnonzero(np.diff(t_s) <= 0) + 1:
        what = "runs backwards" if t_s[index] < t_s[index - 1] else "stands still"
        what = f"time {what} here: t_s {t_s[index]:g} after {t_s[index - 1]:g}"
        remedy = "the file was reordered, or the clock was set while recording"
        faults.append(Problem(lines.file, lines.numbers[index], 0, what, remedy))
    return faults


def _faults_of_size(lines: Lines, numbers: dict[str, NDArray[np.float64]]) -> list[Problem]:
    """First value of each column that is larger than is plausible."""
    faults = []
    for name, values in numbers.items():
        column = columns.COLUMNS[name]
        for index in np.flatnonzero(np.abs(values) > column.size)[:1]:
            what = f"{name} is {values[index]:g}, sizes up to {column.size:g} {column.unit} are plausible"
            remedy = f"check the unit, {column.unit} is needed"
            faults.append(Problem(lines.file, lines.numbers[index], 0, what, remedy))
    return faults
