"""Run files `runs/*.csv`: one circle, one direction, raw.

Whole files are parsed by NumPy at once; line by line only to name what is wrong with a file that it refused. Of a
file that was being recorded when the station died (`.csv.part`) the good lines are returned, the others named.
"""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.files.recordings import run_columns as columns
from dbbstation.files.recordings.run_lines import Lines, fault_of_line, good_lines, split_file
from dbbstation.files.source_text import read_bytes
from dbbstation.trace.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

PART = ".part"
"""Ending, after `.csv`, of a run that is being recorded."""

_MOST_FAULTS = 20
"""Faults of one kind that are listed one by one; nobody reads the ten thousandth."""


@dataclass(frozen=True, eq=False)
class RunFile:
    """A run with what its file says beside the samples.

    Attributes:
        recording: the samples.
        header: what the `# key: value` lines say, by key.
        unknown_columns: text of columns that this program does not know, by name, one entry per sample.
        warnings: what was found that does not spoil the run.
        sha256: of the file's bytes as they were read.
    """

    recording: Recording
    header: Mapping[str, str] = field(default_factory=dict)
    unknown_columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    sha256: str = ""


def read_run(path: Path, *, sha256: str = "") -> RunFile:
    """Read a run file; of one that ends in `.part` the good lines.

    Args:
        path: of the file.
        sha256: what its bytes must hash to; not checked where empty.

    Raises:
        InputError: every fault of the file with its line.
    """
    faults: list[Problem] = []
    data = read_bytes(path, faults, is_input=not sha256)
    if data is None:
        raise InputError(faults)
    digest = hashlib.sha256(data).hexdigest()
    if sha256 and digest != sha256:
        raise InputError([changed(str(path))])
    return parse_run(data, str(path), digest, partial=path.suffix == PART)


def sealed_or_part(path: Path) -> Path:
    """Return where a run's file is: it may have been sealed and renamed just before the station died."""
    sealed = path.with_suffix("") if path.suffix == PART else path
    return sealed if not path.exists() and sealed.exists() else path


def changed(file: str) -> Problem:
    """Return the problem of a file whose hash is not the one that the session noted."""
    what = "the file was changed after it was recorded: its SHA-256 is not the one in the session"
    return Problem(file, 0, 0, what, "restore the file as recorded, or reject the run")


def parse_run(data: bytes, file: str, sha256: str = "", *, partial: bool = False) -> RunFile:
    """Parse the bytes of a run file.

    Args:
        data: whole file.
        file: as named in messages.
        sha256: of the data, passed on.
        partial: return the good lines and name the others in a warning, instead of refusing the file.

    Raises:
        InputError: every fault of the file with its line.
    """
    faults: list[Problem] = []
    warnings: list[Problem] = []
    lines = split_file(data, file, faults)
    if lines is None or faults:
        raise InputError(faults)
    for name in lines.unknown:
        what = f"the column `{name}` is not known; it is kept and not used"
        warnings.append(Problem(file, lines.header_line, 0, what))
    lines = _without_cut_line(lines, warnings)
    if partial:
        lines, bad = good_lines(lines)
        warnings += bad
    numbers = _numbers(lines, faults)
    if not faults:
        _check_values(lines, numbers, faults)
    if faults:
        raise InputError(_few(faults, file))
    return RunFile(
        recording=_recording(lines, numbers),
        header=lines.header,
        unknown_columns={name: tuple(lines.texts(name)) for name in lines.unknown},
        warnings=tuple(_few(warnings, file)),
        sha256=sha256,
    )


def _without_cut_line(lines: Lines, warnings: list[Problem]) -> Lines:
    """Drop a last line that does not end: its last digits may be missing without a trace. Its CRC can vouch for it."""
    if lines.ended or not lines.rows:
        return lines
    number, last = lines.numbers[-1], lines.rows[-1]
    if columns.CRC in lines.columns and fault_of_line(last, lines.columns) is None:
        return lines
    warnings.append(Problem(lines.file, number, 0, "the last line was cut off; it is left out"))
    return lines.keep(slice(0, -1))


def _numbers(lines: Lines, faults: list[Problem]) -> dict[str, NDArray[np.float64]]:
    """Every numeric column, shape (n,); nothing where a line is wrong, with the lines added to `faults`."""
    names = [name for name in lines.columns if name in columns.COLUMNS]
    if not lines.rows:
        faults.append(Problem(lines.file, lines.header_line, 0, "there are no samples below this line"))
        return {}
    if lines.regular() and not lines.bad_crc():
        usecols = [lines.columns.index(name) for name in names]
        text = io.BytesIO(b"\n".join(lines.rows))
        try:
            table = np.loadtxt(text, delimiter=",", usecols=usecols, comments=None, ndmin=2, encoding="latin-1")
        except ValueError:
            table = np.full((0, len(names)), np.nan)
        if len(table) == len(lines.rows) and np.isfinite(table).all():
            return {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)}
    for number, row in zip(lines.numbers, lines.rows, strict=True):
        fault = fault_of_line(row, lines.columns)
        if fault is not None:
            faults.append(Problem(lines.file, number, 0, *fault))
    if not faults:
        what = "NumPy reads this file otherwise than line by line"
        faults.append(Problem(lines.file, 0, 0, what, "write plain decimal numbers"))
    return {}


def _check_values(lines: Lines, numbers: dict[str, NDArray[np.float64]], faults: list[Problem]) -> None:
    """Check that time rises and that every value has a plausible size."""
    t = numbers[columns.TIME]
    for index in np.flatnonzero(np.diff(t) <= 0) + 1:
        what = "runs backwards" if t[index] < t[index - 1] else "stands still"
        what = f"time {what} here: t_s {t[index]:g} after {t[index - 1]:g}"
        remedy = "the file was reordered, or the clock was set while recording"
        faults.append(Problem(lines.file, lines.numbers[index], 0, what, remedy))
    for name, values in numbers.items():
        column = columns.COLUMNS[name]
        for index in np.flatnonzero(np.abs(values) > column.size)[:1]:
            what = f"{name} is {values[index]:g}, sizes up to {column.size:g} {column.unit} are plausible"
            faults.append(
                Problem(lines.file, lines.numbers[index], 0, what, f"check the unit, {column.unit} is needed")
            )


def _recording(lines: Lines, numbers: dict[str, NDArray[np.float64]]) -> Recording:
    none = np.full(len(numbers[columns.TIME]), np.nan)
    currents = [numbers.get(name, none) for name in columns.CURRENTS]
    usable = None
    if columns.STATUS in lines.columns:
        said = lines.texts(columns.STATUS)
        usable = np.array([text in {"", columns.STATUS_GOOD} for text in said], dtype=np.bool_)
    return Recording(
        name=lines.file,
        t_s=numbers[columns.TIME],
        length_mm=numbers[columns.LENGTH],
        theta_deg=numbers.get(columns.THETA),
        temperature_degc={sensor: numbers[name] for name, sensor in columns.TEMPERATURES.items() if name in numbers},
        motor_current_a=np.column_stack(currents) if any(name in numbers for name in columns.CURRENTS) else None,
        usable=usable,
    )


def _few(problems: list[Problem], file: str) -> list[Problem]:
    """Return the problems, or the first of very many with a count of the others."""
    if len(problems) <= _MOST_FAULTS:
        return problems
    more = len(problems) - _MOST_FAULTS
    last = problems[_MOST_FAULTS].line
    return [*problems[:_MOST_FAULTS], Problem(file, last, 0, f"and {more} more of these from here on")]
