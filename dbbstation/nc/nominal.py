"""Check that a program is nominal and for this machine."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.nc.dialect import already_compensated, plain, says_compensated
from dbbstation.nc.mark import decimals_of, is_marked
from dbbstation.nc.toolpath import DECIMALS, RowKind, in_last_decimals

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.toolpath import Toolpath

CHECKSUMS = 99_999_999
"""Line numbers have at most eight digits in LinuxCNC's language: one program in fifty million has its own checksum by chance."""

_MACHINE = re.compile(r"machine\s*[:=]\s*(?P<name>.*\S)\s*", re.IGNORECASE)


class ProgramChecksum:
    """A checksum of moves, dwells and stops in order, with written decimals, over successive parts of a toolpath.

    Comments, feeds, line numbers and units do not count.
    """

    def __init__(self, decimals: Sequence[int] = DECIMALS) -> None:
        self._decimals = decimals
        self._kinds, self._poses, self._dwells = hashlib.sha256(), hashlib.sha256(), hashlib.sha256()

    def add(self, part: Toolpath) -> None:
        """Count the next rows."""
        told = np.isin(part.kind, [RowKind.RAPID, RowKind.FEED, RowKind.DWELL, RowKind.PAUSE])
        counts = part.is_move & (part.unknown == 0)
        poses = np.where(counts[:, None], in_last_decimals(part.numbers_written, self._decimals), 0)
        self._kinds.update(part.kind[told].astype("<i1").tobytes())
        self._poses.update(poses[told].astype("<i8").tobytes())
        self._dwells.update("".join(f"{seconds:.6e} " for seconds in part.dwell_s[part.dwell_s != 0.0]).encode())

    @property
    def number(self) -> int:
        """Return the checksum of all rows so far."""
        digests = (each.digest() for each in (self._kinds, self._poses, self._dwells))
        return 1 + int.from_bytes(hashlib.sha256(b"".join(digests)).digest()[:8]) % CHECKSUMS


def checksum(toolpath: Toolpath, decimals: Sequence[int] = DECIMALS) -> int:
    """Return the checksum of a toolpath."""
    total = ProgramChecksum(decimals)
    for part in toolpath.parts():
        total.add(part)
    return total.number


def check_nominal(toolpath: Toolpath) -> None:
    """Refuse a compensated program.

    Three signs identify it: a comment, the mark in its poses, and the checksum as line number.

    Raises:
        StationError: it is compensated already.
    """
    how = "says its header" if says_compensated(toolpath) else ""
    if (
        not how
        and toolpath.numbers
        and any(checksum(toolpath, each) in toolpath.numbers for each in decimals_of(toolpath))
    ):
        how = "says the checksum in its line numbers"
    if not how and is_marked(toolpath):
        how = "say the last decimals of its poses"
    if how:
        raise already_compensated(toolpath.name, how)


def check_machine(toolpath: Toolpath, machine: Machine) -> None:
    """Refuse a program whose header names another machine.

    Raises:
        StationError: names both.
    """
    own = plain(f"machine: {machine.name}")
    for text in _header(toolpath):
        named = _MACHINE.fullmatch(text)
        if named and plain(f"machine: {named['name']}") != own:
            raise StationError(
                f"its header names the machine {named['name']!r}, the model is of {machine.name!r}",
                where=toolpath.name,
                remedy="give the model of that machine, or post the program for this one",
            )


def _header(toolpath: Toolpath) -> Iterator[str]:
    move = toolpath.first_move
    first = len(toolpath) if move is None else move
    return (text for row, text in toolpath.text.items() if row < first and toolpath.kind[row] == RowKind.COMMENT)
