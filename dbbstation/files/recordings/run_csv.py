"""Read run files `runs/*.csv`: one circle in one direction, raw.

Blocks become lines (`run_lines`), then checked numbers (`run_numbers`), then a recording. An interrupted file
(`.csv.part`) gives its good lines; warnings name the bad ones.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import InputError, Problem, few
from dbbstation.files.formats.session import PART, Counts
from dbbstation.files.gateway import digest_of, opened
from dbbstation.files.inputs import note_input, note_read
from dbbstation.files.recordings.run_lines import pieces_of
from dbbstation.files.recordings.run_numbers import Numbers
from dbbstation.files.source_text import unreadable
from dbbstation.trace import columns
from dbbstation.trace.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from pathlib import Path

    from dbbstation.computing.arrays import Flags, Floats

"""Ending, after `.csv`, of a run that is being recorded."""


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
    sha256: str = ""
    status: tuple[str, ...] = ()


def read_run(path: Path, *, sha256: str = "") -> RunFile:
    """Read a run file, or the good lines of a `.part`.

    Args:
        sha256: expected; empty: not checked.

    Raises:
        InputError: every fault of the file with its line.
    """
    digest = hashlib.sha256()
    try:
        with opened(path) as source:
            note_read(path)
            blocks = _hashed(source.blocks(), digest)
            run: RunFile | InputError
            try:
                run = _parsed(blocks, str(path), partial=path.suffix == PART)
            except InputError as error:
                run = error
            for _ in blocks:
                pass  # what is not worth parsing counts for the hash
    except OSError as error:
        raise InputError([unreadable(path, error)]) from error
    if not sha256:
        note_input(path, digest.hexdigest())
    elif digest.hexdigest() != sha256:
        raise InputError([changed(str(path))])
    if isinstance(run, InputError):
        raise run
    return replace(run, sha256=digest.hexdigest())


def _hashed(blocks: Iterable[bytes], digest: hashlib._Hash) -> Iterator[bytes]:
    for block in blocks:
        digest.update(block)
        yield block


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return digest_of(path)
    except OSError as error:
        raise InputError([unreadable(path, error)]) from error


def changed(file: str) -> Problem:
    """Return the problem of a file whose hash differs from the noted one."""
    what = "the file was changed after it was recorded: its SHA-256 is not the one in the session"
    return Problem(file, 0, 0, what, "restore the file as recorded, or reject the run")


def parse_run(data: bytes, file: str, sha256: str = "", *, partial: bool = False) -> RunFile:
    """Parse the bytes of a run file into a checked recording.

    Args:
        partial: return the good lines and warn of the others.

    Raises:
        InputError: every fault of the file with its line.
    """
    return replace(_parsed([data], file, partial=partial), sha256=sha256)


def _parsed(blocks: Iterable[bytes], file: str, *, partial: bool) -> RunFile:
    faults: list[Problem] = []
    warnings: list[Problem] = []
    numbers = Numbers()
    texts: dict[str, list[str]] = {}
    known: dict[bytes, str] = {}
    header: Mapping[str, str] = {}
    for lines in pieces_of(blocks, file, faults, warnings, partial=partial):
        header = lines.header
        numbers.take(lines)
        if numbers.faults.enough:
            break
        if not numbers.faults.count:
            for name in (name for name in lines.columns if name not in columns.COLUMNS and name != columns.CRC):
                texts.setdefault(name, []).extend(lines.texts(name, known))
    found = numbers.columns()
    faults = [*few(faults), *numbers.faults.told()]
    if faults:
        raise InputError(faults)
    status = texts.pop(columns.STATUS, [])
    usable = np.array([text in {"", columns.STATUS_GOOD} for text in status], dtype=np.bool_) if status else None
    return RunFile(
        recording=_recording(file, found, usable),
        header=header,
        unknown_columns={name: tuple(cells) for name, cells in texts.items()},
        warnings=tuple(few(warnings)),
        status=tuple(status),
    )


_BY_THEMSELVES = (columns.TIME, columns.LENGTH, columns.THETA)
"""Columns that are separate attributes of a recording."""


def _recording(file: str, numbers: Mapping[str, Floats], usable: Flags | None) -> Recording:
    return Recording(
        name=file,
        t_s=numbers[columns.TIME],
        length_mm=numbers[columns.LENGTH],
        theta_deg=numbers.get(columns.THETA),
        logged={name: values for name, values in numbers.items() if name not in _BY_THEMSELVES},
        usable=usable,
    )


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
