"""Trial of a dialect: it must read its own programs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import StationError
from dbbstation.machine.geometry import Rotation
from dbbstation.nc.mark import is_marked, marked
from dbbstation.nc.rs274.reader import read_program
from dbbstation.nc.toolpath import IN_FORCE, MESSAGE, Ending, RowKind, ToolpathBuilder
from dbbstation.nc.words import WordDialect

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.toolpath import Toolpath

MOVES = "G21 G90 G0 X10 Y-20 Z-1000 A1 B-2 C3\nG1 X10.5 C3.5 F600"
"""First lines of every trial, in LinuxCNC's language: two moves."""

POSE_WITHIN = 1e-3
"""Largest difference between a written and a read pose [mm, deg]; each dialect chooses its decimals."""

SHARE_WITHIN = 1e-4
"""Largest relative difference of feeds and dwells."""


def faults_of(dialect: Dialect) -> list[str]:
    """Return a sentence for each difference between written and read rows; empty if the dialect is usable.

    Raises:
        Exception: whatever the dialect raises while it writes moves, or reads what it wrote.
    """
    moves = _commanded()
    read = _read(dialect, moves)
    wanted, places = (each.poses[each.is_move] for each in (moves, read))
    if places.shape != wanted.shape or not np.allclose(places, wanted, atol=POSE_WITHIN):
        return ["it does not read the two moves that it wrote"]
    faults = _differences(moves, read, "two moves")
    has_words: list[str] = []
    for what, lines in THINGS.items():
        wrote = _commanded(lines)
        try:
            text = dialect.write(wrote)
        except StationError:
            continue  # it has no words for this, and says so
        has_words.append(lines)
        try:
            read = dialect.read(text, "trial" + dialect.extension)
        except StationError as error:
            faults.append(f"it does not read what it wrote of {what}: {str(error).splitlines()[0]}")
        else:
            faults += _differences(wrote, read, what)
    if not faults:
        wrote = _commanded(*has_words)
        faults = _differences(wrote, _read(dialect, wrote), "all in one program")
    return (
        faults
        or _faults_of_guard(dialect, moves)
        or _faults_of_table(dialect, moves)
        or _faults_of_mark(dialect, moves)
    )


def _faults_of_table(dialect: Dialect, moves: Toolpath) -> list[str]:
    """Check TCP, the order of rotation and the alphabet of comments."""
    file, letters = "trial" + dialect.extension, [chr(letter) for letter in range(32, 127)]
    text, tcp = dialect.write(moves, letters), getattr(dialect, "words", {}).get("tcp on", "")
    if not isinstance(dialect.rotation, Rotation | None):
        return ["its `rotation` is no Rotation"]
    try:
        faults = _differences(moves, dialect.read(text, file), "comments of every letter")
    except StationError as error:
        faults = [f"it does not read its own comments: {str(error).splitlines()[0]}"]
    if faults or not tcp:
        return faults
    try:
        dialect.read("".join(line for line in text.splitlines(keepends=True) if tcp not in line), file)
    except StationError:
        return []
    return [f"it reads X, Y and Z as the tool tip without `{tcp}`"]


def _faults_of_guard(dialect: Dialect, moves: Toolpath) -> list[str]:
    guarded = replace(moves, holds={IN_FORCE: (0.0,) * 6})
    faults = _differences(moves, _read(dialect, guarded), "a check of offsets")
    checks = isinstance(dialect, WordDialect) and type(dialect).guard is not WordDialect.guard
    if not faults and checks and dialect.write(guarded) == dialect.write(moves):
        return ["it loses the check of offsets"]
    return faults


def _faults_of_mark(dialect: Dialect, moves: Toolpath) -> list[str]:
    turns = np.linspace(0.0, 6.0, 41)[:, None] + np.arange(3.0)
    poses = moves.poses[0] + np.hstack([20.0 * np.sin(turns), 3.0 * np.cos(turns)])
    curve = ToolpathBuilder("trial")
    curve.rapid(poses[0])
    curve.feed(poses[1:], 600.0)
    if is_marked(_read(dialect, marked(curve.built(), dialect.decimals))):
        return []
    return [
        f"it cannot be marked: what it writes with {' '.join(map(str, dialect.decimals))} decimals is read otherwise"
    ]


def _each_moved(*lines: str) -> str:
    return "\n".join(f"{line}\nG1 X{10 + k} Y-19 C3 F500" for k, line in enumerate(lines))


THINGS = {
    "feeds": "G1 X10 C3 F1234.5\nG1 A3 F90\nG1 X10.5 Y-20 A1 C3.5 F0.25",
    "dwells": "G4 P0.5\nG4 P12.25",
    "stops": _each_moved("M0", f"({MESSAGE}turn the part)\nM0"),
    "an optional stop": _each_moved("M1"),
    "the spindle": _each_moved("S1200 M3", "M5", "S800.5 M4"),
    "a slow spindle": _each_moved("S0.00001 M3"),
    "coolant": _each_moved("M8", "M7", "M9"),
    "a tool": _each_moved("T2 M6", "M61 Q3"),
    "a message": _each_moved(f"({MESSAGE}hello)"),
    "a work system": "G55\nG0 X10 Y-20",
    "machine coordinates": "G53 G0 Z-950\nG0 Z-1000",
    "path control": _each_moved("G61", "G64 P0.02", "G64"),
    "an end without M2": Ending.TEXT,
    "M30": Ending.REWIND,
}
"""Lines that a program may contain behind the two moves, or its ending."""


class _Row(NamedTuple):
    what: str
    numbers: tuple[float, ...] = ()
    within: tuple[float, ...] = ()

    def is_like(self, other: _Row) -> bool:
        return self.what == other.what and bool(
            np.allclose(self.numbers, other.numbers, rtol=0.0, atol=self.within, equal_nan=True)
        )

    def __str__(self) -> str:
        return " ".join([self.what, *(f"{number:g}" for number in self.numbers)])


def _commanded(*things: str) -> Toolpath:
    lines = [MOVES, *(thing for thing in things if not isinstance(thing, Ending)), "M2"]
    endings = [thing for thing in things if isinstance(thing, Ending)]
    path = read_program("\n".join(lines), "trial")
    return replace(path, holds=None, ending=[path.ending, *endings][-1])


def _read(dialect: Dialect, wrote: Toolpath) -> Toolpath:
    return dialect.read(dialect.write(wrote), "trial" + dialect.extension)


def _differences(wrote: Toolpath, read: Toolpath, tried: str) -> list[str]:
    one, other = list(_rows(wrote)), list(_rows(read))
    for row, (mine, yours) in enumerate(zip(one, other, strict=False)):
        if not mine.is_like(yours):
            # Where as many rows are missing in all as lie before the next one like this, they are lost.
            missing = len(one) - len(other)
            if missing > 0 and row + missing < len(one) and one[row + missing].is_like(yours):
                return [f"it loses `{mine}` ({tried})"]
            return [f"it wrote `{mine}` and reads `{yours}` ({tried})"]
    if len(other) < len(one):
        return [f"it loses `{one[len(other)]}` ({tried})"]
    if len(other) > len(one):
        return [f"it reads `{other[len(one)]}`, which it did not write ({tried})"]
    return []


def _with_messages(path: Toolpath) -> dict[int, str | None]:
    """Return texts by row; None: ignore this row. A message before a stop counts as the stop's text, because dialects write both in one row or two."""
    texts: dict[int, str | None] = dict(path.text)
    told = np.flatnonzero(path.kind != RowKind.COMMENT)
    for row, after in pairwise(told.tolist()):
        said = path.text.get(row, "")
        if path.kind[row] == RowKind.MESSAGE and said.startswith(MESSAGE) and path.kind[after] == RowKind.PAUSE:
            texts |= {row: None, after: texts.get(after) or said.removeprefix(MESSAGE)}
    return texts


def _rows(path: Toolpath) -> Iterator[_Row]:
    feeds, corner, texts = path.feed, np.nan, _with_messages(path)
    for row, kind in enumerate(path.kind.tolist()):
        text = texts.get(row, "")
        if kind in {RowKind.RAPID, RowKind.FEED}:
            if not np.array_equal(path.corners_mm[row], corner, equal_nan=True):
                corner = float(path.corners_mm[row])
                yield _Row("corners within", (corner,), (SHARE_WITHIN * abs(np.nan_to_num(corner)),))
            system = " in machine coordinates" if path.in_machine[row] else ""
            pose = tuple(path.poses[row].tolist())
            yield _Row(f"{'rapid' if kind == RowKind.RAPID else 'feed'}{system} to", pose, (POSE_WITHIN,) * 6)
            if kind == RowKind.FEED:
                unit = "deg/min" if path.only_turns[row] else "mm/min"
                yield _Row(f"feed in {unit}", (feeds[row],), (SHARE_WITHIN * feeds[row],))
        elif kind == RowKind.DWELL:
            yield _Row("dwell in s", (path.dwell_s[row],), (SHARE_WITHIN * path.dwell_s[row],))
        elif kind == RowKind.FUNCTION:
            yield from (_Row(word) for word in str(text).split())
        elif kind != RowKind.COMMENT and text is not None:
            yield _Row(f"{RowKind(kind).name.lower().replace('_', ' ')} {text}".strip())
    yield _Row(f"end by {path.ending.value}")
