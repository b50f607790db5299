"""A toolpath: the machine's actions in an NC program, independent of the control's language."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats, Integers

DECIMALS = (6, 6, 6, 7, 7, 7)
"""Decimals of X, Y, Z [mm], A, B, C [deg] in programs: rounding shifts the tip, and a point a metre from it, by at most
0.0009 µm."""

LEAST_MM = LEAST_DEG = 1e-8
"""An axis that moves by less is stationary: LinuxCNC's limit, per axis [CART_FUZZ in libnml/posemath/posemath.h,
applied by applyMinDisplacement in emc/task/emccanon.cc; mm and degrees]. Sums of increments end within this distance of
their target."""

RAPID_MM_MIN = 5000.0
"""Assumed speed of rapids: programs do not state it, and nothing is measured during rapids."""

RAPID_DEG_MIN = 2000.0
"""The same for rapids that tilt the platform."""


class RowKind(IntEnum):
    """Kind of a toolpath row."""

    RAPID = 0
    FEED = 1
    DWELL = 2
    PAUSE = 3
    """Stop until the operator goes on."""
    COMMENT = 4
    FUNCTION = 5
    """Words of spindle and coolant, which move no axis and mean the same to every control."""
    OPTIONAL_STOP = 6
    """Stop that the operator has switched on or off (M1)."""
    MESSAGE = 7
    """Text that the control shows or writes to a file: keyword, comma, text, as in `MSG, hello`."""
    SYSTEM = 8
    """Change of the offset of the following numbers: `G54` to `G59.3`, `G10 L2 …`, `G43 H1`, `G49`; or `G28`, a move to
    a position that only the control knows."""


MESSAGE = "MSG, "
"""First characters of a message that the control shows."""


class Ending(StrEnum):
    """How a program ends."""

    STOP = "M2"
    REWIND = "M30"
    TEXT = "%"
    """End of the text, between percent signs: spindle and coolant stay as they are."""


IN_FORCE = "in force"
"""Stands for the control's active work system at the begin of the program."""

EXACT_STOP_MM = -1.0
"""Rounding of moves that stop at their ends (G61.1), beside 0 for the exact path (G61)."""

SYSTEMS = ("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")
"""Work coordinate systems in order, from number 1."""

PIECE_CORNER_MM = 1e-4
"""Largest rounding of corners between the pieces of one exact move: 0.1 µm, less than a bar detects. An exact stop
belongs to the end of the written move; the angles between its pieces need far less."""


@dataclass(frozen=True, eq=False)
class Toolpath:
    """Rows in order; every move is straight in all of X, Y, Z, A, B and C.

    Attributes:
        name: for messages; the file if read from one.
        kind: `RowKind` of each row, shape (n,).
        poses: [X, Y, Z, A, B, C] after each row in machine coordinates, without tool length, shape (n, 6) [mm, deg].
        feed_mm_min: of `FEED` rows along the tip's path, shape (n,); NaN in other rows.
        feed_deg_min: of `FEED` rows that only turn, shape (n,); NaN in other rows.
        dwell_s: of `DWELL` rows, shape (n,); zero in other rows.
        line: of the program, from 1, shape (n,); 0 if there is none.
        text: words of `PAUSE`, `COMMENT` and `FUNCTION` rows, by row.
        start: pose before the first row, shape (6,), NaN for unknown axes; None: all unknown.
        corners_mm: rounding allowed at the end of each row, shape (n,): 0 exact, `EXACT_STOP_MM`, infinite unlimited, NaN not stated.
        offset: row of `offsets` by which numbers of each row are less than its pose, shape (n,).
        offsets: work offset, G92 and tool length together, shape (k, 6) [mm, deg]; the first is zero.
        unknown: axes whose position the program does not know, a bit each, shape (n,): such a row must not name them.
        in_machine: moves in machine coordinates (G53), shape (n,).
        holds: offsets and tool lengths for which the poses are valid, by `IN_FORCE`, `G54`, `G92`, `H1`, each shape
            (6,), and diameters of tools by `D1`, shape (1,); a control may check them before it moves. None: not stated.
        units_said: whether the program states its unit of length.
        notes: sentences on what the program leaves open.
        files: number of lines before each of its files, and the file's name; subprograms of other files follow the program.
        numbers: first and last line number; a compensated program carries its checksum in the first.
        run: number of the program among those written together, from 1.
        arc: centre [mm] in the first and second axis of its plane, spanned angle of a chord [rad], counter-clockwise positive, plane
            as in `PLANES`, shape (n, 4); angle 0 in straight rows. None: no arcs.
    """

    name: str
    kind: NDArray[np.int8]
    poses: Floats
    feed_mm_min: Floats
    feed_deg_min: Floats
    dwell_s: Floats
    line: Integers
    corners_mm: Floats
    offset: NDArray[np.int32]
    offsets: Floats
    unknown: NDArray[np.uint8]
    in_machine: Flags
    text: Mapping[int, str] = field(default_factory=dict)
    start: Floats | None = None
    holds: Mapping[str, tuple[float, ...]] | None = None
    ending: Ending = Ending.STOP
    units_said: bool = True
    notes: tuple[str, ...] = ()
    files: tuple[tuple[int, str], ...] = ()
    numbers: tuple[int, ...] = ()
    arc: Floats | None = None
    run: int = 1

    def __len__(self) -> int:
        return len(self.kind)

    def where(self, row: int) -> str:
        """Return the line of a row as text for messages."""
        return self.place(int(self.line[row]))

    def place(self, line: int) -> str:
        """Return a line as text for messages; 0 is the program."""
        before, file = next((each for each in reversed(self.files) if 0 < each[0] < line), (0, self.name))
        return f"{file}:{line - before}" if line else file

    @property
    def corner_mm(self) -> float | None:
        """Return the rounding allowed at the first move [mm], or None."""
        corners = self.corners_mm[self.is_move]
        return None if not len(corners) or np.isnan(corners[0]) else float(corners[0])

    def divided(self, row: Integers, poses: Floats) -> Toolpath:
        """Return the toolpath with some rows divided into pieces."""
        last = np.append(row[1:] != row[:-1], True)[: len(row)]
        place = dict(zip(row[last].tolist(), np.flatnonzero(last).tolist(), strict=True))
        corners = self.corners_mm[row]
        return replace(
            self.only(row),
            poses=poses,
            corners_mm=np.where((corners <= 0.0) & ~last, PIECE_CORNER_MM, corners),
            text=MappingProxyType({place[old]: text for old, text in self.text.items()}),
            arc=None,
        )

    def part(self, rows: slice) -> Toolpath:
        """Return successive rows as a toolpath without texts."""
        begins = rows.indices(len(self))[0]
        return replace(self.only(rows), start=self.start if begins == 0 else self.before[begins])

    def only(self, rows: slice | Integers) -> Toolpath:
        """Return some rows as a toolpath without texts; each move begins at the end of the move before."""
        of_rows = {name: getattr(self, name)[rows] for name in _OF_ROWS}
        arc = None if self.arc is None else self.arc[rows]
        return replace(self, **of_rows, text=MappingProxyType({}), arc=arc)

    @property
    def is_move(self) -> Flags:
        """Return which rows are moves, with or without distance, shape (n,)."""
        return (self.kind == RowKind.RAPID) | (self.kind == RowKind.FEED)

    @cached_property
    def before(self) -> Floats:
        """Return the pose before each row, shape (n, 6) [mm, deg]. If unknown, it is the pose after the row."""
        first = self.poses[:1] if self.start is None else np.where(np.isnan(self.start), self.poses[:1], self.start)
        return np.vstack([first, self.poses])[: len(self)]

    @property
    def numbers_written(self) -> Floats:
        """Return the written numbers of each pose, shape (n, 6), without work offsets and tool length."""
        return self.poses - self.offsets[self.offset]

    def with_numbers(self, numbers: Floats) -> Toolpath:
        """Return the toolpath with other written numbers, shape (n, 6)."""
        return replace(self, poses=numbers + self.offsets[self.offset])

    @cached_property
    def tip_mm(self) -> Floats:
        """Return the tool tip's travel in each row, shape (n,) [mm]; zero if it is only rounding."""
        return _norm(self.poses[:, :3] - self.before[:, :3], LEAST_MM)

    @cached_property
    def turn_deg(self) -> Floats:
        """Return the root sum of squares of each row's three turns, shape (n,) [deg]; zero if it is only rounding."""
        return _norm(self.poses[:, 3:] - self.before[:, 3:], LEAST_DEG)

    @property
    def only_turns(self) -> Flags:
        """Return which rows turn the platform without moving the tip, shape (n,)."""
        return (self.tip_mm == 0.0) & (self.turn_deg > 0.0)

    @property
    def feed(self) -> Floats:
        """Return F of each row, shape (n,): along the path [mm/min], or of angles [deg/min] if only they move."""
        return np.where(self.only_turns, self.feed_deg_min, self.feed_mm_min)

    @cached_property
    def duration_s(self) -> Floats:
        """Return the time of each row at its feed, without ramps, shape (n,) [s].

        F refers to X, Y and Z, and to the angles only if X, Y and Z do not move [RS274/NGC 2.1.2.5; LinuxCNC does the
        same].
        """
        way = np.where(self.tip_mm > 0.0, self.tip_mm, self.turn_deg)
        feeding = np.divide(60.0 * way, self.feed, out=np.zeros(len(self)), where=self.kind == RowKind.FEED)
        rapid = 60.0 * np.maximum(self.tip_mm / RAPID_MM_MIN, self.turn_deg / RAPID_DEG_MIN)
        return self.dwell_s + np.where(self.kind == RowKind.RAPID, rapid, feeding)

    @cached_property
    def end_s(self) -> Floats:
        """Return the time at the end of each row from the start, shape (n,) [s]."""
        return np.cumsum(self.duration_s)

    def at_time(self, time_s: Floats) -> Floats:
        """Return commanded poses at times after the start, shape (n, 6); the first and last pose apply outside the program's time."""
        if not len(self):
            raise ValueError(f"{self.name} has no moves")
        nodes, ends_s = np.vstack([self.before[:1], self.poses]), np.concatenate([[0.0], self.end_s])
        return np.column_stack([np.interp(time_s, ends_s, nodes[:, axis]) for axis in range(6)])

    def between(self, row: Integers, share: Floats) -> Floats:
        """Return poses within rows, shape (k, 6); `share` 0 before the row, 1 after it, both of shape (k,)."""
        before, after = self.before[row], self.poses[row]
        inside = before + share[:, None] * (after - before)
        if self.arc is not None:
            chord = np.flatnonzero(self.arc[row, 2] != 0.0)
            arc, plane = self.arc[row[chord]], PLANES[self.arc[row[chord], 3].astype(np.int64)]
            first, last = (np.take_along_axis(each[chord], plane, axis=1) for each in (before, after))
            inside[chord[:, None], plane] = _on_arc(first, last, arc, share[chord])
        # The end of a row is its programmed pose to the last bit.
        return np.where(share[:, None] == 1.0, after, inside)

    def subdivided(self, step_mm: float, step_deg: float) -> tuple[Integers, Floats]:
        """Divide rows into pieces that are no longer than the steps; return row and share of each piece's end, shapes (k,)."""
        return in_pieces(self.pieces(step_mm, step_deg))

    def pieces(self, step_mm: float, step_deg: float) -> Integers:
        """Return the number of pieces of each row, shape (n,)."""
        pieces = np.ceil(np.maximum(self.tip_mm / step_mm, self.turn_deg / step_deg))
        return np.maximum(pieces, 1.0).astype(np.int64)


_ALIKE: dict[str, type] = {
    "kind": np.int8,
    "dwell_s": np.float64,
    "offset": np.int32,
    "unknown": np.uint8,
    "in_machine": np.bool_,
}
_OF_ROWS = (*_ALIKE, "poses", "feed_mm_min", "feed_deg_min", "line", "corners_mm")
"""Arrays of a toolpath with a value for each row. In the arrays of `_ALIKE`, rows that are added together share one
value."""

_NO_FEED = (np.nan, np.nan)
_STRAIGHT = (0.0, 0.0, 0.0, 0.0)

PLANES = np.array([[0, 1], [2, 0], [1, 2]])
"""First and second axis of G17, G18 and G19: counter-clockwise turns the first towards the second."""

ALL_AXES = 0b111111


class _Rows(NamedTuple):
    kind: RowKind
    poses: Floats
    feed: tuple[float, float]
    dwell_s: float
    line: int
    corner_mm: float
    offset: int
    unknown: int
    in_machine: bool
    arc: tuple[float, float, float, float]
    step: int


class ToolpathBuilder:
    """Collects the rows of a toolpath.

    Args:
        start: pose before the first row, shape (6,) [mm, deg], NaN for unknown axes; None: all unknown.

    Attributes:
        corner_mm: rounding allowed in the moves that follow; None: not stated.
        unknown: axes with unknown position, a bit each; a move that names or feeds them makes them known.
        fed: rows up to the last move at feed.
        left: rows up to the last rapid.
    """

    def __init__(self, name: str, start: Floats | None = None) -> None:
        self.name = name
        self.corner_mm: float | None = None
        self.holds: dict[str, tuple[float, ...]] | None = None
        self.ending = Ending.STOP
        self.units_said = True
        self.notes: tuple[str, ...] = ()
        self.files: tuple[tuple[int, str], ...] = ()
        self.numbers: tuple[int, ...] = ()
        self._start = start
        self._pose = np.full(6, np.nan) if start is None else np.asarray(start, dtype=np.float64)
        self.unknown = bits_of(np.isnan(self._pose))
        self._offsets: dict[tuple[float, ...], int] = {(0.0,) * 6: 0}
        self._offset = 0
        self._rows: list[_Rows] = []
        self._text: dict[int, str] = {}
        self._count = self.fed = self.left = 0

    def count_from(self, offset: Sequence[float]) -> None:
        """Set the offset of following moves' numbers from their poses, shape (6,) [mm, deg]."""
        self._offset = self._offsets.setdefault(tuple(float(each) for each in offset), len(self._offsets))

    def lines(self, poses: Floats, feed: tuple[float, float] | None, *, line: int) -> None:
        """Add the moves of successive lines, poses of shape (k, 6) [mm, deg], at feeds per distance and per angle; None: rapids."""
        kind = RowKind.RAPID if feed is None else RowKind.FEED
        self._add(kind, poses, feed or _NO_FEED, line=line, step=1)
        if feed is None:
            self.left = self._count
        else:
            self.fed = self._count

    def rapid(self, pose: Floats, *, line: int = 0, in_machine: bool = False, unknown: int = 0) -> None:
        """Add a move as fast as the machine can."""
        self.unknown = unknown
        self._add(RowKind.RAPID, pose[None], line=line, in_machine=in_machine)
        self.left = self._count

    def feed(
        self,
        poses: Floats,
        mm_min: float,
        deg_min: float | None = None,
        *,
        line: int = 0,
        in_machine: bool = False,
        arc: tuple[float, float, float, float] = _STRAIGHT,
        unknown: int = 0,
    ) -> None:
        """Add moves at a feed.

        Args:
            deg_min: of moves that only turn; None: `mm_min`.
        """
        self.unknown = unknown
        feed = (mm_min, mm_min if deg_min is None else deg_min)
        self._add(RowKind.FEED, poses, feed, line=line, in_machine=in_machine, arc=arc)
        self.fed = self._count

    @property
    def pose(self) -> Floats:
        """Return the pose at the end of the last row, shape (6,) [mm, deg]."""
        return self._pose.copy()

    @property
    def added(self) -> int:
        """Return how many rows were added together last."""
        return len(self._rows) - 1

    def bend(
        self,
        added: int,
        poses: Floats,
        arc: tuple[float, float, float, float],
        plane: Integers,
    ) -> None:
        """Replace the poses of rows that were added together. All later rows get their end position in the axes of a plane."""
        self._rows[added].poses[:] = poses
        self._rows[added] = self._rows[added]._replace(arc=arc)
        for rows in self._rows[added + 1 :]:
            rows.poses[:, plane] = poses[-1, plane]

    def dwell(self, seconds: float, *, line: int = 0) -> None:
        """Add a stop of known duration."""
        self._add(RowKind.DWELL, self._pose[None], dwell_s=seconds, line=line)

    def say(self, kind: RowKind, text: str, *, line: int = 0) -> None:
        """Add a row of words."""
        if text:
            self._text[self._count] = text
        self._add(kind, self._pose[None], line=line)

    def taken_back(self) -> str:
        """Remove the last row added by `say` and return its text."""
        self._rows.pop()
        self._count -= 1
        return self._text.pop(self._count, "")

    @property
    def last_kind(self) -> RowKind | None:
        """Return the kind of the last row, or None."""
        return self._rows[-1].kind if self._rows else None

    @property
    def last_text(self) -> str:
        """Return the text of the last row, or an empty one."""
        return self._text.get(self._count - 1, "")

    def built(self) -> Toolpath:
        """Return the toolpath of all rows so far. An axis begins at its first named position; an unknown axis keeps its position."""
        count = np.array([len(rows.poses) for rows in self._rows], dtype=np.int64)

        def each(values: list[Any], kind: type) -> NDArray[Any]:
            return np.repeat(np.array(values, dtype=kind), count, axis=0)

        poses = np.vstack([np.empty((0, 6)), *(rows.poses for rows in self._rows)])
        for axis in np.flatnonzero(np.isnan(poses).any(axis=0)):
            known = np.flatnonzero(~np.isnan(poses[:, axis]))
            last = np.searchsorted(known, np.arange(len(poses)), side="right") - 1
            poses[:, axis] = poses[known[np.maximum(last, 0)], axis] if len(known) else 0.0
        alike: Any = {name: each([getattr(rows, name) for rows in self._rows], kind) for name, kind in _ALIKE.items()}
        return Toolpath(
            name=self.name,
            **alike,
            poses=poses,
            feed_mm_min=each([rows.feed[0] for rows in self._rows], np.float64),
            feed_deg_min=each([rows.feed[1] for rows in self._rows], np.float64),
            line=each([rows.line for rows in self._rows], np.int64)
            + each([rows.step for rows in self._rows], np.int64) * self._within(count),
            corners_mm=self._corners_mm(count),
            offsets=np.array(list(self._offsets)),
            text=MappingProxyType(dict(self._text)),
            start=self._start,
            holds=self.holds,
            ending=self.ending,
            units_said=self.units_said,
            notes=self.notes,
            files=self.files,
            numbers=self.numbers,
            arc=each([rows.arc for rows in self._rows], np.float64).reshape(-1, 4),
        )

    def __len__(self) -> int:
        return self._count

    @staticmethod
    def _within(count: Integers) -> Integers:
        """Return the index of each row among the rows that were added together, from 0, shape (n,)."""
        behind = np.cumsum(count)
        numbers: Integers = np.arange(behind[-1] if len(count) else 0) - np.repeat(behind - count, count)
        return numbers

    def _corners_mm(self, count: Integers) -> Floats:
        """Return the rounding of each row; an arc in chords stops only at the arc's ends."""
        corners = np.repeat(np.array([rows.corner_mm for rows in self._rows], dtype=np.float64), count)
        last = np.repeat(np.array([rows.step > 0 for rows in self._rows], dtype=np.bool_), count)
        last[np.cumsum(count) - 1] = True
        inner: Floats = np.where((corners <= 0.0) & ~last, PIECE_CORNER_MM, corners)
        return inner

    def _add(
        self,
        kind: RowKind,
        poses: Floats,
        feed: tuple[float, float] = _NO_FEED,
        *,
        dwell_s: float = 0.0,
        line: int,
        in_machine: bool = False,
        arc: tuple[float, float, float, float] = _STRAIGHT,
        step: int = 0,
    ) -> None:
        corner_mm = np.nan if self.corner_mm is None else self.corner_mm
        poses = np.array(poses, dtype=np.float64)
        offset = 0 if in_machine else self._offset
        rows = _Rows(kind, poses, feed, dwell_s, line, corner_mm, offset, self.unknown, in_machine, arc, step)
        self._rows.append(rows)
        self._count += len(poses)
        self._pose = poses[-1]


def bits_of(axes: Flags) -> int:
    """Return axes, shape (6,), as bits of a number."""
    return int(axes @ (1 << np.arange(6)))


def _on_arc(
    before: Floats,
    after: Floats,
    arc: Floats,
    share: Floats,
) -> Floats:
    centre, turned = arc[:, :2], share * arc[:, 2]
    first, last = before - centre, after - centre
    radius = np.linalg.norm(first, axis=1)
    scale = 1.0 + share * (np.linalg.norm(last, axis=1) / radius - 1.0)
    cos, sin = scale * np.cos(turned), scale * np.sin(turned)
    x, y = first.T
    return centre + np.column_stack([cos * x - sin * y, sin * x + cos * y])


def in_pieces(pieces: Integers) -> tuple[Integers, Floats]:
    """Return row and end share of each piece, shapes (k,), from the number of pieces in each row, shape (n,)."""
    row = np.repeat(np.arange(len(pieces)), pieces)
    number = np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 1
    return row, number / pieces[row]


def rounded(poses: Floats, decimals: Sequence[int] = DECIMALS) -> Floats:
    """Return poses, shape (n, 6), rounded to the decimals of programs, without -0."""
    return np.column_stack([np.round(poses[:, axis], places) for axis, places in enumerate(decimals)]) + 0.0


def _norm(vectors: Floats, least: float) -> Floats:
    """Return the lengths of vectors, shape (n, 3); components below `least` count as zero."""
    length: Floats = np.linalg.norm(np.where(np.abs(vectors) < least, 0.0, vectors), axis=1)
    return length
