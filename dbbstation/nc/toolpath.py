"""A toolpath: the machine's actions in an NC program, independent of the control's language."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import IntEnum, StrEnum
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from dbbstation.facts import of_facts
from dbbstation.machine.geometry import Frames
from dbbstation.nc.spilled import Spilled, forget

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.machine.geometry import Rotation

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


ORDER_DEG = 0.05
"""Longest piece of a move that turns, in another order of rotation. Its middle leaves the turn by the square of it: at most
0.02 µm at a point 100 mm from the tip."""

ROWS_AT_ONCE = 5_000
"""Rows that are handled together. A program of 50,000 blocks takes a tenth longer with 20,000 rows, whose arrays leave the
processor's cache; one of 10,000 takes a twentieth longer with 8,000."""


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


PLANES = np.array([[0, 1], [2, 0], [1, 2]])
"""First and second axis of G17, G18 and G19: counter-clockwise leads from the first to the second."""

ALL_AXES = 0b111111

STRAIGHT = (0.0, 0.0, 0.0, 0.0)

ROW = np.dtype(
    [
        ("poses", np.float64, 6),
        ("feed_mm_min", np.float64),
        ("feed_deg_min", np.float64),
        ("dwell_s", np.float64),
        ("corners_mm", np.float64),
        ("line", np.int32),
        ("offset", np.int32),
        ("arc_number", np.int32),
        ("kind", np.int8),
        ("unknown", np.uint8),
        ("in_machine", np.bool_),
    ],
    align=True,
)
"""A row of a toolpath: 96 bytes.

`kind` is a `RowKind`. `poses` is [X, Y, Z, A, B, C] after the row in machine coordinates, without tool length [mm, deg].
`feed_mm_min` is the speed of the tip in `FEED` rows, `feed_deg_min` the speed of `FEED` rows that only turn; both are NaN in
other rows. `dwell_s` is zero except in `DWELL` rows. `line` is the program's line, from 1; 0 if there is none. `corners_mm` is
the rounding allowed at the row's end: 0 exact, `EXACT_STOP_MM`, infinite unlimited, NaN not stated. `offset` is a row of
`offsets`, by which the row's numbers are less than its pose; `arc_number` is a row of `arcs`. `unknown` has a bit for each axis
whose position the program does not know: such a row must not name it. `in_machine` marks moves in machine coordinates (G53).
"""


def _column(name: str, kind: str) -> Any:  # noqa: ANN401 - a property of any array
    return property(lambda self: self.rows[name], doc=f"Return `{name}` of each row, as in `ROW`{kind}.")


@dataclass(frozen=True, eq=False)
class Toolpath:
    """Rows in order; every move is straight in X, Y, Z, A, B and C at once.

    Attributes:
        name: for messages; the file if read from one.
        rows: shape (n,), of the type `ROW`.
        text: words of `PAUSE`, `COMMENT` and `FUNCTION` rows, by row.
        start: pose before the first row, shape (6,), NaN for unknown axes; None: all unknown.
        offsets: work offset, G92 and tool length together, shape (k, 6) [mm, deg]; the first is zero.
        arcs: centre [mm] in the first and second axis of its plane, spanned angle of a chord [rad], counter-clockwise positive, plane
            as in `PLANES`, shape (k, 4); the first has angle 0 and belongs to straight rows.
        holds: offsets and tool lengths for which the poses are valid, by `IN_FORCE`, `G54`, `G92`, `H1`, each shape
            (6,), and diameters of tools by `D1`, shape (1,); a control may check them before it moves. None: not stated.
        units_said: whether the program states its unit of length.
        notes: sentences on what the program leaves open.
        files: number of lines before each of its files, and the file's name; subprograms of other files follow the program.
        numbers: first and last line number; a compensated program carries its checksum in the first.
        run: number of the program among those written together, from 1.
        rotation: order in which A, B and C turn; None: the machine's.
    """

    name: str
    rows: NDArray[np.void]
    offsets: Floats
    arcs: Floats
    text: Mapping[int, str] = field(default_factory=dict)
    start: Floats | None = None
    holds: Mapping[str, tuple[float, ...]] | None = None
    ending: Ending = Ending.STOP
    units_said: bool = True
    notes: tuple[str, ...] = ()
    files: tuple[tuple[int, str], ...] = ()
    numbers: tuple[int, ...] = ()
    run: int = 1
    rotation: Rotation | None = None

    kind: ClassVar[NDArray[np.int8]] = _column("kind", "")
    poses: ClassVar[Floats] = _column("poses", ", shape (n, 6)")
    feed_mm_min: ClassVar[Floats] = _column("feed_mm_min", "")
    feed_deg_min: ClassVar[Floats] = _column("feed_deg_min", "")
    dwell_s: ClassVar[Floats] = _column("dwell_s", "")
    line: ClassVar[Integers] = _column("line", "")
    corners_mm: ClassVar[Floats] = _column("corners_mm", "")
    offset: ClassVar[Integers] = _column("offset", "")
    unknown: ClassVar[NDArray[np.uint8]] = _column("unknown", "")
    in_machine: ClassVar[Flags] = _column("in_machine", "")

    def __len__(self) -> int:
        return len(self.rows)

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
        corner_mm = np.nan if self.first_move is None else float(self.corners_mm[self.first_move])
        return None if np.isnan(corner_mm) else corner_mm

    @property
    def first_move(self) -> int | None:
        """Return the row of the first move, or None."""
        moves = (np.flatnonzero(part.is_move) + ROWS_AT_ONCE * number for number, part in enumerate(self.parts()))
        return next((int(rows[0]) for rows in moves if len(rows)), None)

    @property
    def arc(self) -> Floats:
        """Return each row's arc, shape (n, 4), as in `arcs`."""
        return self.arcs[self.rows["arc_number"]]

    def changed(self, **columns: Any) -> Toolpath:  # noqa: ANN401 - arrays of any type
        """Return the toolpath with other columns of `ROW`."""
        rows = self.rows.copy()
        for name, values in columns.items():
            rows[name] = values
        return replace(self, rows=rows)

    def divided(self, row: Integers, poses: Floats) -> Toolpath:
        """Return the toolpath with some rows in several straight pieces."""
        last = np.append(row[1:] != row[:-1], True)[: len(row)]
        corners = self.corners_mm[row]
        corners[(corners <= 0.0) & ~last] = PIECE_CORNER_MM
        divided = self.only(row).changed(poses=poses, corners_mm=corners, arc_number=0)
        ends = np.searchsorted(row, list(self.text), side="right") - 1
        return replace(divided, text=dict(zip(ends.tolist(), self.text.values(), strict=True)))

    def in_order(self, order: Rotation) -> Toolpath:
        """Return the toolpath with A, B and C in another order of rotation; moves that turn become pieces."""
        if self.rotation is None or self.rotation is order:
            return self
        row, share = self.subdivided(np.inf, ORDER_DEG)
        poses = Frames.from_poses(self.between(row, share), self.rotation).to_poses(order)
        start = None if self.start is None else Frames.from_poses(self.start[None], self.rotation).to_poses(order)[0]
        return replace(self.divided(row, poses), start=start, rotation=order)

    def part(self, rows: slice) -> Toolpath:
        """Return successive rows as a toolpath."""
        begin, end, _ = rows.indices(len(self))
        text = {row - begin: self.text[row] for row in range(begin, end) if row in self.text} if self.text else {}
        return replace(self.only(rows), start=self.poses[begin - 1] if begin else self.start, text=text)

    def parts(self) -> Iterator[Toolpath]:
        """Yield successive rows as toolpaths, at least one: a long program is checked and written in little memory."""
        for begin in range(0, max(len(self), 1), ROWS_AT_ONCE):
            yield self.part(slice(begin, begin + ROWS_AT_ONCE))
            forget(self.rows)

    def only(self, rows: slice | Integers) -> Toolpath:
        """Return some rows as a toolpath without texts; each move begins at the end of the move before."""
        return replace(self, rows=self.rows[rows], text={})

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
        return self.changed(poses=numbers + self.offsets[self.offset])

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
        chord = np.flatnonzero(self.rows["arc_number"][row])
        if len(chord):
            arc = self.arc[row[chord]]
            plane = PLANES[arc[:, 3].astype(np.int64)]
            first, last = (np.take_along_axis(each[chord], plane, axis=1) for each in (before, after))
            inside[chord[:, None], plane] = on_arc(first, last, arc, share[chord])
        # The end of a row is its programmed pose to the last bit.
        return np.where(share[:, None] == 1.0, after, inside)

    def subdivided(self, step_mm: float, step_deg: float) -> tuple[Integers, Floats]:
        """Divide rows into pieces that are no longer than the steps; return row and share of each piece's end, shapes (k,)."""
        return in_pieces(self.pieces(step_mm, step_deg))

    def pieces(self, step_mm: float, step_deg: float) -> Integers:
        """Return the number of pieces of each row, shape (n,)."""
        pieces = np.ceil(np.maximum(self.tip_mm / step_mm, self.turn_deg / step_deg))
        return np.maximum(pieces, 1.0).astype(np.int64)


_NO_FEED = (np.nan, np.nan)


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
        self.unknown = ALL_AXES if start is None else bits_of(np.isnan(start))
        self._offsets: dict[tuple[float, ...], int] = {(0.0,) * 6: 0}
        self._offset = 0
        self._rows, self._arcs = Spilled(ROW), Spilled((np.float64, len(STRAIGHT)))
        self._arcs.add(np.array([STRAIGHT]))
        self._text: dict[int, str] = {}
        self.fed = self.left = 0
        self._is_built = False

    def count_from(self, offset: Sequence[float]) -> None:
        """Set the offset of following moves' numbers from their poses, shape (6,) [mm, deg]."""
        self._offset = self._offsets.setdefault(tuple(float(each) for each in offset), len(self._offsets))

    def lines(self, poses: Floats, feed: tuple[float, float] | None, *, line: int) -> None:
        """Add the moves of successive lines, poses of shape (k, 6) [mm, deg], at feeds per distance and per angle; None: rapids."""
        kind = RowKind.RAPID if feed is None else RowKind.FEED
        self._add(kind, poses, feed or _NO_FEED, line=line, step=1)

    def rapid(self, pose: Floats, *, line: int = 0, in_machine: bool = False, unknown: int = 0) -> None:
        """Add a move as fast as the machine can."""
        self.unknown = unknown
        self._add(RowKind.RAPID, pose[None], line=line, in_machine=in_machine)

    def feed(
        self,
        poses: Floats,
        mm_min: float,
        deg_min: float | None = None,
        *,
        line: int = 0,
        in_machine: bool = False,
        arc: tuple[float, float, float, float] = STRAIGHT,
        unknown: int = 0,
    ) -> None:
        """Add moves at a feed.

        Args:
            deg_min: of moves that only turn; None: `mm_min`.
        """
        self.unknown = unknown
        feed = (mm_min, mm_min if deg_min is None else deg_min)
        self._add(RowKind.FEED, poses, feed, line=line, in_machine=in_machine, arc=arc)

    @property
    def pose(self) -> Floats:
        """Return the pose at the end of the last row, shape (6,) [mm, deg]."""
        if len(self) == 0:
            return np.full(6, np.nan) if self._start is None else np.array(self._start, dtype=np.float64)
        return np.array(self._rows.values["poses"][-1])

    def bend(
        self,
        first: int,
        poses: Floats,
        arc: tuple[float, float, float, float],
        plane: Integers,
    ) -> None:
        """Replace the poses of rows that were added together. All later rows get the last pose's coordinates in a plane."""
        behind, rows = first + len(poses), self._rows.values
        rows["poses"][first:behind] = poses
        number = rows["arc_number"][first]
        if number:
            self._arcs.values[number] = arc
        rows["poses"][behind:, plane] = poses[-1, plane]

    def dwell(self, seconds: float, *, line: int = 0) -> None:
        """Add a stop of known duration."""
        self._add(RowKind.DWELL, self.pose[None], dwell_s=seconds, line=line)

    def say(self, kind: RowKind, text: str, *, line: int = 0) -> None:
        """Add a row of words."""
        if text:
            self._text[len(self)] = text
        self._add(kind, self.pose[None], line=line)

    def taken_back(self) -> str:
        """Remove the last row added by `say` and return its text."""
        self._rows.take_back()
        return self._text.pop(len(self), "")

    @property
    def last_kind(self) -> RowKind | None:
        """Return the kind of the last row, or None."""
        return RowKind(self._rows.values["kind"][-1]) if len(self) else None

    @property
    def last_text(self) -> str:
        """Return the text of the last row, or an empty one."""
        return self._text.get(len(self) - 1, "")

    def built(self) -> Toolpath:
        """Return the toolpath of all rows so far. An axis begins at its first named position; an unknown axis keeps its position."""
        self._is_built = True
        blocks = [slice(begin, begin + ROWS_AT_ONCE) for begin in range(0, len(self), ROWS_AT_ONCE)]
        before, poses = np.full(6, np.nan), self._rows.values["poses"]
        for block in blocks:
            if not np.isnan(before).any():
                break
            before = np.where(np.isnan(before), going_on(poses[block][::-1], before)[-1], before)
        before = np.nan_to_num(before, nan=0.0)
        for block in blocks:
            if np.isnan(poses[block]).any():
                poses[block] = going_on(poses[block], before)
            before = poses[block][-1]
            forget(poses)
        return of_facts(
            Toolpath,
            self,
            rows=self._rows.values,
            offsets=np.array(list(self._offsets)),
            arcs=self._arcs.values,
            text=MappingProxyType(dict(self._text)),
            start=self._start,
        )

    def __len__(self) -> int:
        return len(self._rows)

    def _add(
        self,
        kind: RowKind,
        poses: Floats,
        feed: tuple[float, float] = _NO_FEED,
        *,
        dwell_s: float = 0.0,
        line: int,
        in_machine: bool = False,
        arc: tuple[float, ...] = STRAIGHT,
        step: int = 0,
    ) -> None:
        if self._is_built:  # a toolpath has these rows
            built, self._rows, self._is_built = self._rows.values, Spilled(ROW), False
            self._rows.add(built)
        if arc[2] != 0.0:
            self._arcs.add(np.array([arc]))
        corner_mm = np.nan if self.corner_mm is None else self.corner_mm
        number, offset = len(self._arcs) - 1 if arc[2] != 0.0 else 0, 0 if in_machine else self._offset
        rows = self._rows.room(len(poses))
        rows[:] = (0.0, *feed, dwell_s, corner_mm, line, offset, number, kind, self.unknown, in_machine)
        rows["poses"] = poses
        if step:
            rows["line"] += step * np.arange(len(rows), dtype=np.int32)
        elif corner_mm <= 0.0:
            rows["corners_mm"][:-1] = PIECE_CORNER_MM  # an arc as chords stops only at its own ends
        self.fed = len(self) if kind == RowKind.FEED else self.fed
        self.left = len(self) if kind == RowKind.RAPID else self.left


def joined(parts: Sequence[Toolpath]) -> Toolpath:
    """Return successive parts as one toolpath."""
    begins = np.cumsum([0, *map(len, parts)]).tolist()
    text = {begin + row: said for begin, part in zip(begins, parts, strict=False) for row, said in part.text.items()}
    return replace(parts[0], rows=np.concatenate([part.rows for part in parts]), text=text)


def going_on(values: Floats, before: Floats) -> Floats:
    """Return modal values, shape (n, k): each NaN gets the value of the row above. `before`, shape (k,), is the row above the first."""
    known = np.vstack([before, values])
    at = np.where(np.isnan(known), 0, np.arange(len(known))[:, None])
    return np.take_along_axis(known, np.maximum.accumulate(at, axis=0), axis=0)[1:]


def bits_of(axes: Flags) -> int:
    """Return axes, shape (6,), as bits of a number."""
    return int(axes @ (1 << np.arange(6)))


def on_arc(before: Floats, after: Floats, arc: Floats, share: Floats) -> Floats:
    """Return points at shares of arcs in their planes, shape (k, 2) [mm]; the radius changes evenly.

    Args:
        before: begin of each arc, shape (k, 2), or of one arc for all shares, shape (1, 2) [mm].
        after: end of each arc, of the same shape.
        arc: as in `Toolpath.arcs`; the plane is not needed.
    """
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


def in_last_decimals(numbers: Floats, decimals: Sequence[int]) -> Integers:
    """Return numbers, shape (n, k), in units of their last decimals, of which each column has its own."""
    return np.rint(numbers * 10.0 ** np.array(decimals)).astype(np.int64)


def rounded(poses: Floats, decimals: Sequence[int] = DECIMALS) -> Floats:
    """Return poses, shape (n, 6), rounded to the decimals of programs, without -0."""
    return in_last_decimals(poses, decimals) / 10.0 ** np.array(decimals)


def lengths(vectors: Floats) -> Floats:
    """Return lengths of vectors, shape (n, 3), in a third of the time of NumPy's `norm`."""
    return np.sqrt(np.einsum("ni,ni->n", vectors, vectors))


def _norm(vectors: Floats, least: float) -> Floats:
    """Return the lengths of vectors, shape (n, 3); components below `least` count as zero."""
    return lengths(np.where(np.abs(vectors) < least, 0.0, vectors))
