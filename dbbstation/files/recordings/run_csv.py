"""Run files `runs/*.csv`: one circle, one direction, raw.

One way leads in: bytes to lines (`run_lines`), lines to checked numbers (`run_numbers`), numbers to a recording. Of a
file that was being recorded when the station died (`.csv.part`) the good lines are returned, the others named.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError, Problem
from dbbstation.files.recordings.run_lines import Lines, lines_of
from dbbstation.files.recordings.run_numbers import numbers_of
from dbbstation.files.source_text import read_bytes
from dbbstation.trace import columns
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
        status: what the instrument said of each sample; empty where nothing was noted.
        warnings: what was found that does not spoil the run.
        sha256: of the file's bytes as they were read.
    """

    recording: Recording
    header: Mapping[str, str] = field(default_factory=dict)
    unknown_columns: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()
    sha256: str = ""
    status: tuple[str, ...] = ()


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


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file.

    Raises:
        InputError: it cannot be read.
    """
    faults: list[Problem] = []
    data = read_bytes(path, faults, is_input=False)
    if data is None:
        raise InputError(faults)
    return hashlib.sha256(data).hexdigest()


def sealed_or_part(path: Path) -> Path:
    """Return where a run's file is: it may have been sealed and renamed just before the station died."""
    sealed = path.with_suffix("") if path.suffix == PART else path
    return sealed if not path.exists() and sealed.exists() else path


def changed(file: str) -> Problem:
    """Return the problem of a file whose hash is not the one that the session noted."""
    what = "the file was changed after it was recorded: its SHA-256 is not the one in the session"
    return Problem(file, 0, 0, what, "restore the file as recorded, or reject the run")


def parse_run(data: bytes, file: str, sha256: str = "", *, partial: bool = False) -> RunFile:
    """Parse the bytes of a run file: bytes to lines, lines to numbers, numbers to a recording, each checked.

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
    lines = lines_of(data, file, faults, warnings, partial=partial)
    numbers = None if lines is None else numbers_of(lines, faults)
    if lines is None or numbers is None:
        raise InputError(_few(faults, file))
    return RunFile(
        recording=_recording(lines, numbers),
        header=lines.header,
        unknown_columns={name: tuple(lines.texts(name)) for name in lines.unknown},
        warnings=tuple(_few(warnings, file)),
        sha256=sha256,
        status=tuple(lines.texts(columns.STATUS)) if columns.STATUS in lines.columns else (),
    )


_BY_THEMSELVES = (columns.TIME, columns.LENGTH, columns.THETA)
"""Columns that a recording has in places of their own."""


def _recording(lines: Lines, numbers: dict[str, NDArray[np.float64]]) -> Recording:
    usable = None
    if columns.STATUS in lines.columns:
        said = lines.texts(columns.STATUS)
        usable = np.array([text in {"", columns.STATUS_GOOD} for text in said], dtype=np.bool_)
    return Recording(
        name=lines.file,
        t_s=numbers[columns.TIME],
        length_mm=numbers[columns.LENGTH],
        theta_deg=numbers.get(columns.THETA),
        logged={name: values for name, values in numbers.items() if name not in _BY_THEMSELVES},
        usable=usable,
    )


def _few(problems: list[Problem], file: str) -> list[Problem]:
    """Return the problems, or the first of very many with a count of the others."""
    if len(problems) <= _MOST_FAULTS:
        return problems
    more = len(problems) - _MOST_FAULTS
    last = problems[_MOST_FAULTS].line
    return [*problems[:_MOST_FAULTS], Problem(file, last, 0, f"and {more} more of these from here on")]
