"""Trial of a dialect: it must read its own programs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dbbstation.errors import StationError
from dbbstation.machine.geometry import Rotation
from dbbstation.nc.mark import is_marked, marked
from dbbstation.nc.toolpath import IN_FORCE, MESSAGE, Ending, RowKind, ToolpathBuilder
from dbbstation.nc.words import WordDialect

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dbbstation.computing.arrays import Floats
    from dbbstation.nc.dialect import Dialect
    from dbbstation.nc.toolpath import Toolpath

FIRST = np.array([10.0, -20.0, -1000.0, 1.0, -2.0, 3.0])
SECOND = np.array([10.5, -20.0, -1000.0, 1.0, -2.0, 3.5])

POSE_WITHIN = 1e-3
"""Largest difference between a written and a read pose [mm, deg]; each dialect chooses its decimals."""

SHARE_WITHIN = 1e-4
"""Largest relative difference of feeds and dwells."""


def faults_of(dialect: Dialect) -> list[str]:
    """Return a sentence for each difference between written and read rows; empty if the dialect is usable.

    Raises:
        Exception: whatever the dialect raises while it writes moves, or reads what it wrote.
    """
    moves = _built([_moves])
    read = _read(dialect, moves)
    places = read.poses[read.is_move]
    if places.shape != (2, 6) or not np.allclose(places, [FIRST, SECOND], atol=POSE_WITHIN):
        return ["it does not read the two moves that it wrote"]
    faults = _differences(moves, read, "two moves")
    has_words: list[Callable[[ToolpathBuilder], None]] = [_moves]
    for what, add in THINGS.items():
        wrote = _built([_moves, add])
        try:
            text = dialect.write(wrote)
        except StationError:
            continue  # it has no words for this, and says so
        has_words.append(add)
        try:
            read = dialect.read(text, "trial" + dialect.extension)
        except StationError as error:
            faults.append(f"it does not read what it wrote of {what}: {str(error).splitlines()[0]}")
        else:
            faults += _differences(wrote, read, what)
    if not faults:
        wrote = _built(has_words)
        faults = _differences(wrote, _read(dialect, wrote), "all in one program")
    return faults or _faults_of_guard(dialect, moves) or _faults_of_table(dialect, moves) or _faults_of_mark(dialect)


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


def _faults_of_mark(dialect: Dialect) -> list[str]:
    path = _built([_curve])
    if is_marked(_read(dialect, marked(path, dialect.decimals))):
        return []
    return [
        f"it cannot be marked: what it writes with {' '.join(map(str, dialect.decimals))} decimals is read otherwise"
    ]


def _curve(path: ToolpathBuilder) -> None:
    turns = np.linspace(0.0, 6.0, 41)[:, None] + np.arange(3.0)
    poses = FIRST + np.hstack([20.0 * np.sin(turns), 3.0 * np.cos(turns)])
    path.rapid(poses[0])
    path.feed(poses[1:], 600.0)


def _from_first(by: list[float]) -> Floats:
    return FIRST + np.array(by)


def _moves(path: ToolpathBuilder) -> None:
    path.rapid(FIRST)
    path.feed(SECOND[None], 600.0)


def _feeds(path: ToolpathBuilder) -> None:
    path.feed(FIRST[None], 1234.5)
    path.feed(_from_first([0, 0, 0, 2, 0, 0])[None], 90.0)
    path.feed(SECOND[None], 0.25)


def _dwell(path: ToolpathBuilder) -> None:
    path.dwell(0.5)
    path.dwell(12.25)


def _said(kind: RowKind, *texts: str) -> Callable[[ToolpathBuilder], None]:
    def add(path: ToolpathBuilder) -> None:
        for number, text in enumerate(texts):
            path.say(kind, text)
            path.feed(_from_first([number, 1, 0, 0, 0, 0])[None], 500.0)

    return add


def _systems(path: ToolpathBuilder) -> None:
    path.say(RowKind.SYSTEM, "G55")
    path.rapid(FIRST)


def _machine(path: ToolpathBuilder) -> None:
    path.rapid(_from_first([0, 0, 50, 0, 0, 0]), in_machine=True)
    path.rapid(FIRST)


def _corners(path: ToolpathBuilder) -> None:
    for number, corner_mm in enumerate((0.0, 0.02, np.inf)):
        path.corner_mm = corner_mm
        path.feed(_from_first([0, 1 + number, 0, 0, 0, 0])[None], 500.0)


def _ends(ending: Ending) -> Callable[[ToolpathBuilder], None]:
    def add(path: ToolpathBuilder) -> None:
        path.ending = ending

    return add


THINGS: dict[str, Callable[[ToolpathBuilder], None]] = {
    "feeds": _feeds,
    "dwells": _dwell,
    "stops": _said(RowKind.PAUSE, "", "turn the part"),
    "an optional stop": _said(RowKind.OPTIONAL_STOP, ""),
    "the spindle": _said(RowKind.FUNCTION, "S1200 M3", "M5", "S800.5 M4"),
    "a slow spindle": _said(RowKind.FUNCTION, "S0.00001 M3"),
    "coolant": _said(RowKind.FUNCTION, "M8", "M7", "M9"),
    "a tool": _said(RowKind.FUNCTION, "T2 M6", "M61 Q3"),
    "a message": _said(RowKind.MESSAGE, "MSG, hello"),
    "a work system": _systems,
    "machine coordinates": _machine,
    "path control": _corners,
    "an end without M2": _ends(Ending.TEXT),
    "M30": _ends(Ending.REWIND),
}
"""Rows that a program may contain beside two moves."""


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


def _built(things: list[Callable[[ToolpathBuilder], None]]) -> Toolpath:
    path = ToolpathBuilder("trial")
    for add in things:
        add(path)
    return path.built()


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
