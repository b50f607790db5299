"""Read run files `runs/*.csv`: one circle in one direction, raw.

Blocks become lines (`run_lines`), then checked numbers (`Numbers`), then a recording. An interrupted file
(`.csv.part`) gives its good lines; warnings name the bad ones.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MOST_FAULTS, Faults, InputError, Problem, few, refuse
from dbbstation.files.formats.session import PART, Counts
from dbbstation.files.gateway import digest_of, opened
from dbbstation.files.inputs import note_input, open_book
from dbbstation.files.recordings.run_lines import fault_of_line, pieces_of
from dbbstation.files.source_text import readable
from dbbstation.trace import columns
from dbbstation.trace.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    from dbbstation.computing.arrays import Floats
    from dbbstation.files.recordings.run_lines import Lines


class Counted(Faults):
    """The first faults of a file, and their count."""

    number = 0

    def append(self, fault: Problem) -> None:
        """Count a fault and keep the first."""
        self.number += 1
        if len(self) <= MOST_FAULTS:
            super().append(fault)

    @property
    def enough(self) -> bool:
        """Return whether further lines need not be read."""
        return self.number >= _MOST_COUNTED

    def told(self) -> list[Problem]:
        """Return the first faults, and how many follow."""
        return few(self, self.number)


_MOST_COUNTED = 10_000
"""Greatest number of counted faults; more add no information."""


class Numbers:
    """Numeric columns of a run file, 8 bytes a number."""

    def __init__(self, file: str) -> None:
        self.faults = Counted(file)
        self._parts: dict[str, list[Floats]] = {}
        self._last: Lines | None = None

    def take(self, lines: Lines) -> None:
        """Add the rows of a piece."""
        self._last = lines
        if not lines.rows:
            return
        numbers = _numbers_in(lines)
        if numbers is None:
            _check_lines(lines, self.faults)
        elif not self.faults.number:
            for name, values in numbers.items():
                self._parts.setdefault(name, []).append(values)

    def columns(self) -> dict[str, Floats]:
        """Return every numeric column, shape (n,), and release the pieces; faults are added to `faults`."""
        last = self._last
        if self.faults.number or last is None:
            return {}
        if not self._parts:
            self.faults.add("there are no samples below this line", line=last.header_line)
            return {}
        # One column after the other, so that no more than one stands twice in the memory.
        joined = {name: np.concatenate(self._parts.pop(name)) for name in list(self._parts)}
        count = len(joined[columns.TIME])
        numbers = (
            last.numbers if len(last.numbers) == count else range(last.header_line + 1, last.header_line + 1 + count)
        )
        limits = {name: (columns.COLUMNS[name].size, columns.COLUMNS[name].unit) for name in joined}
        check_numbers(joined, limits, numbers, self.faults)
        return joined


def _numbers_in(lines: Lines) -> dict[str, Floats] | None:
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


def _check_lines(lines: Lines, faults: Counted) -> None:
    before = faults.number
    for number, row in zip(lines.numbers, lines.rows, strict=True):
        fault = fault_of_line(row, lines.columns)
        if fault is not None:
            faults.add(*fault, number)
    if faults.number == before:
        faults.add("NumPy reads this file otherwise than line by line", "write plain decimal numbers")


def check_numbers(
    found: Mapping[str, Floats], limits: Mapping[str, tuple[float, str]], lines: Sequence[int], faults: Faults
) -> None:
    """Check that the time rises, and that no number is too large.

    Args:
        found: columns by name, each of shape (n,).
        limits: greatest plausible size of each column, and its unit.
        lines: of the rows.
    """
    t_s = found[columns.TIME]
    for index in (np.flatnonzero(t_s[1:] <= t_s[:-1]) + 1).tolist():
        how = "runs backwards" if t_s[index] < t_s[index - 1] else "stands still"
        what = f"time {how} here: t_s {t_s[index]:g} after {t_s[index - 1]:g}"
        faults.add(what, "the file was reordered, recordings were joined, or the clock was set", lines[index])
    for name, values in found.items():
        size, unit = limits[name]
        for index in np.flatnonzero((values > size) | (values < -size))[:1].tolist():
            what = f"{name} is {values[index]:g}, sizes up to {size:g} {unit} are plausible"
            faults.add(what, f"check the unit, {unit} is needed", lines[index])


@dataclass(frozen=True, eq=False)
class RunFile:
    """A run, and the other content of its file.

    Attributes:
        header: `# key: value` lines, by key.
        unknown_columns: texts by name, one per sample.
        status: of the instrument at each sample; empty if not recorded.
        warnings: findings that do not invalidate the run.
    """

    recording: Recording
    header: Mapping[str, str] = field(default_factory=dict)
    unknown_columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    status: tuple[str, ...] = ()


def read_run(path: Path, *, sha256: str = "") -> RunFile:
    """Read a run file, or the good lines of a `.part`.

    Args:
        sha256: expected; empty: not checked.

    Raises:
        InputError: every fault of the file with its line.
    """
    digest = hashlib.sha256()
    with readable(path), opened(path) as source:
        open_book().note_read(path)
        blocks = _hashed(source.blocks(), digest)
        run: RunFile | InputError
        try:
            run = _parsed(blocks, str(path), partial=path.suffix == PART)
        except InputError as error:
            run = error
        for _ in blocks:
            pass  # what is not worth parsing counts for the hash
    if not sha256:
        note_input(path, digest.hexdigest())
    elif digest.hexdigest() != sha256:
        raise InputError([changed(str(path))])
    if isinstance(run, InputError):
        raise run
    return run


def _hashed(blocks: Iterable[bytes], digest: hashlib._Hash) -> Iterator[bytes]:
    for block in blocks:
        digest.update(block)
        yield block


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file.

    Raises:
        InputError: it cannot be read.
    """
    with readable(path):
        return digest_of(path)


def changed(file: str) -> Problem:
    """Return the problem of a file whose hash differs from the noted one."""
    what = "the file was changed after it was recorded: its SHA-256 is not the one in the session"
    return Problem.of(file, what, "restore the file as recorded, or reject the run")


def parse_run(data: bytes, file: str, *, partial: bool = False) -> RunFile:
    """Parse the bytes of a run file into a checked recording.

    Args:
        partial: return the good lines and warn of the others.

    Raises:
        InputError: every fault of the file with its line.
    """
    return _parsed([data], file, partial=partial)


def _parsed(blocks: Iterable[bytes], file: str, *, partial: bool) -> RunFile:
    faults, warnings = Faults(file), Faults(file)
    numbers = Numbers(file)
    texts: dict[str, list[str]] = {}
    header: Mapping[str, str] = {}
    for lines in pieces_of(blocks, faults, warnings, partial=partial):
        header = lines.header
        numbers.take(lines)
        if numbers.faults.enough:
            break
        if not numbers.faults.number:
            for name in (name for name in lines.columns if name not in columns.COLUMNS and name != columns.CRC):
                texts.setdefault(name, []).extend(lines.texts(name))
    found = numbers.columns()
    refuse([*few(faults), *numbers.faults.told()])
    status = texts.pop(columns.STATUS, [])
    usable = np.array([text in {"", columns.STATUS_GOOD} for text in status], dtype=np.bool_) if status else None
    return RunFile(
        recording=Recording(
            name=file,
            t_s=found[columns.TIME],
            length_mm=found[columns.LENGTH],
            theta_deg=found.get(columns.THETA),
            logged={name: values for name, values in found.items() if name not in _BY_THEMSELVES},
            usable=usable,
        ),
        header=header,
        unknown_columns={name: tuple(cells) for name, cells in texts.items()},
        warnings=tuple(few(warnings)),
        status=tuple(status),
    )


_BY_THEMSELVES = (columns.TIME, columns.LENGTH, columns.THETA)
"""Columns that are separate attributes of a recording."""


def counts_in(header: Mapping[str, str]) -> Counts | None:
    """Return the counts in a run file's `# key: value` lines, or None."""
    received, lost = count_in(header.get("received", "")), count_in(header.get("lost", ""))
    if received is None or lost is None:
        return None
    prefix = "rejected "
    said = {key.removeprefix(prefix): count_in(value) for key, value in header.items() if key.startswith(prefix)}
    return Counts(received, lost, {reason: count for reason, count in said.items() if count})


def count_in(text: str) -> int | None:
    """Return the non-negative integer of a text, or None."""
    return int(text) if re.fullmatch(r"[0-9]{1,12}", text) else None
