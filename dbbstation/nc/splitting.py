"""Split moves into pieces that follow the commanded curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled
from dbbstation.errors import StationError
from dbbstation.nc.curve import felt_mm, in_mm, row_and_share
from dbbstation.nc.spilled import forget
from dbbstation.nc.toolpath import ROWS_AT_ONCE, RowKind, in_pieces

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.nc.curve import CommandCurve
    from dbbstation.nc.toolpath import Toolpath

FIRST_CELL_MM, FIRST_CELL_DEG = 50.0, 5.0
"""Largest first cells of a move, before any cell is halved."""

OF_A_PERIOD = 0.25
"""First cells are at most this share of the shortest period in the model: start, middle and end of a longer cell can
all be zeros of a wave. On 150 lines with random screw errors the largest error was 2.0 µm without this limit, 0.11 µm
with the whole period or half of it, 0.10 µm with a quarter or a tenth [docs/validation.md]."""

LOOKED_AT = np.array([0.19, 0.5, 0.73, 1.0])
"""Shares of a cell at which the curve is computed: unevenly spaced, so that a wave is not sampled at its zeros only."""

SHORT_MM, SHORT_DEG, SHORT_OF_A_PERIOD = 1.0, 0.1, 0.02
"""In shorter moves at feed one middle point is enough: the curve is then a parabola."""

MIDDLE = np.array([0.5, 1.0])

FINER = 16.0
"""Cells are halved until the curve leaves their chord by less than this share of the tolerance. The ends of pieces are
then close to their best positions, and the curve between two points can be neglected."""

OF_THE_TOLERANCE = 0.95
"""Share of the tolerance that pieces may use at the computed points; between them the curve deviates a little more."""

SHORTEST_MM, SHORTEST_DEG = 0.05, 0.01
"""Least size of halved cells. No chord fits a step of the correction (backlash at a strut's reversal); it is placed
within this distance."""

HISTORY_MM, HISTORY_DEG = 5.0, 1.0
"""Steps in which rapids are computed, for backlash and friction. Each rapid is still written as one move, since it cuts
nothing."""

ALMOST = 0.999
"""Relative amount by which a move may be shorter than needed."""

COSINE = 0.97
"""Cosine of the greatest angle between short lines of one curve, 14 degrees."""

MOST_CELLS = 1_000_000
"""Greatest number of cells of one part, which are held in memory together."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Begins and ends of pieces, as positions on `CommandCurve`, shapes (k,)."""

    begin: Floats
    end: Floats

    @property
    def row(self) -> Integers:
        """Return the row in which each piece ends, shape (k,)."""
        return row_and_share(self.end)[0]

    def places(self, shares: Floats) -> Floats:
        """Return places at shares of each piece, shape (k, len(shares)); share 1 is exactly its end."""
        inside = self.begin[:, None] + (self.end - self.begin)[:, None] * shares
        return np.where(shares == 1.0, self.end[:, None], inside)


def moves_of(toolpath: Toolpath) -> Integers:
    """Return the written move of each row, shape (n,); an arc is one move."""
    goes_on = np.zeros(len(toolpath), dtype=np.bool_)
    number = toolpath.rows["arc_number"]
    if number.any():
        same = (number[1:] == number[:-1]) & (number[1:] != 0)
        goes_on[1:] = same & (toolpath.line[1:] == toolpath.line[:-1]) & (toolpath.kind[1:] == toolpath.kind[:-1])
    return np.cumsum(~goes_on) - 1


def parts_of(toolpath: Toolpath, runs_in: Callable[[Toolpath], Integers]) -> Iterator[tuple[Toolpath, Integers]]:
    """Yield successive parts with each row's run, so that long programs take little memory."""
    begin = 0
    while begin < len(toolpath) or begin == 0:
        end, rows = 0, ROWS_AT_ONCE + 1
        while not end:
            part = toolpath.part(slice(begin, begin + rows))
            runs = runs_in(part)
            end = _end_of_part(part, runs) if begin + rows < len(toolpath) else len(part)
            rows *= 2
        yield part.part(slice(end)), runs[:end]
        forget(toolpath.rows)
        begin = max(begin + end, 1)


def _end_of_part(part: Toolpath, runs: Integers) -> int:
    """Return the last row with which another part may begin, preferably the first row of a run; 0 without such a row."""
    leads_on = (part.tip_mm > 0.0) | (part.turn_deg > 0.0)
    # The first move shows where the machine comes from.
    may = np.flatnonzero(leads_on)[1:]
    may = may[(part.kind[may] == RowKind.FEED) & (part.tip_mm[may] > 0.0)]
    new_run = may[runs[may] != runs[may - 1]]
    found = new_run if len(new_run) else may
    return int(found[-1]) if len(found) else 0


def runs_of(toolpath: Toolpath, needed_mm: Floats) -> Integers:
    """Return the number of each row's run, shape (n,). A run is a written move, or several moves that are too short for their feed.

    The moves of a run share F and work system, may round their corners, and nearly keep their direction.

    Args:
        needed_mm: length of a piece that keeps the feed, shape (n,).
    """
    moves = moves_of(toolpath)
    if len(toolpath) < 2:  # noqa: PLR2004 - a pair
        return moves
    cuts = (toolpath.kind == RowKind.FEED) & (toolpath.tip_mm > 0.0)
    short = cuts & (np.bincount(moves, weights=toolpath.tip_mm)[moves] < ALMOST * needed_mm)
    way = toolpath.poses[:, :3] - toolpath.before[:, :3]
    along = np.einsum("ni,ni->n", way[1:], way[:-1]) >= COSINE * toolpath.tip_mm[1:] * toolpath.tip_mm[:-1]
    alike = (toolpath.feed[1:] == toolpath.feed[:-1]) & (toolpath.offset[1:] == toolpath.offset[:-1])
    joined = (short[1:] | short[:-1]) & cuts[1:] & cuts[:-1] & along & alike & ~(toolpath.corners_mm[:-1] <= 0.0)
    joined |= moves[1:] == moves[:-1]
    return np.concatenate([[0], np.cumsum(~joined)])


def split(
    curve: CommandCurve,
    model: MachineModel,
    tolerance_mm: float,
    runs: Integers,
    *,
    whole: Flags,
) -> tuple[Pieces, Floats, Floats]:
    """Return the longest pieces of a toolpath that keep the tolerance.

    Return pieces, the poses to command at their begins and ends, shape (k, 2, 6) [mm, deg], and the distance of the
    curve from each chord, shape (k,) [mm]; NaN for pieces of several cells.

    Args:
        model: its shortest period determines the sampling.
        tolerance_mm: greatest distance of a piece from the curve.
        runs: run of each row, within which pieces may end anywhere, shape (n,).
        whole: rows of one piece each, shape (n,).

    Raises:
        StationError: the path has too many cells.
    """
    cells, at, shares = _cells(curve, model, tolerance_mm, whole)
    off_mm = off_chord_mm(at, shares)
    toolpath, row = curve.toolpath, cells.row
    # What needs no choice: what is no move at feed, and moves that are one cell near the curve.
    number = runs[row]
    chosen = (toolpath.kind[row] == RowKind.FEED) & curve.leads_on[row] & ~whole[row]
    alone = np.bincount(number)[number] == 1
    chosen &= ~alone | (off_mm > OF_THE_TOLERANCE * tolerance_mm)
    may_end, must_end = np.zeros((2, *at[:, 1:, 0].shape), dtype=np.bool_)
    # A cell with a step in it is not cut again.
    may_end[chosen & (off_mm <= tolerance_mm)] = may_end[:, -1] = True
    must_end[:-1, -1], must_end[-1:, -1] = (number[1:] != number[:-1]) | ~chosen[1:] | ~chosen[:-1], True
    nodes = np.vstack([at[:1, 0], at[:, 1:].reshape(-1, 6)])
    places = np.concatenate([cells.begin[:1], cells.places(shares).reshape(-1)])
    node_row, share = row_and_share(places)
    way = np.where(np.bincount(runs, weights=toolpath.tip_mm)[runs] > 0.0, toolpath.tip_mm, toolpath.turn_deg)
    behind = np.cumsum(way) - way
    way = behind[node_row] + share * way[node_row]
    may, must = (np.concatenate([[False], each.reshape(-1)]) for each in (may_end, must_end))
    ended = longest(way, in_mm(nodes), may, must, OF_THE_TOLERANCE * tolerance_mm)
    begun = np.concatenate([[0], ended[:-1]])
    cell = (ended - 1) // len(shares)
    known = np.where(chosen[cell], np.nan, off_mm[cell])
    return Pieces(places[begun], places[ended]), nodes[np.column_stack([begun, ended])], known


def off_chord_mm(at: Floats, shares: Floats) -> Floats:
    """Return the distance of the curve from each piece's chord, shape (k,) [mm]."""
    begin, end = at[:, 0], at[:, -1]
    off = [felt_mm(at[:, 1 + k] - (begin + share * (end - begin))) for k, share in enumerate(shares[:-1])]
    return np.max(off, axis=0)


def looked_at(
    curve: CommandCurve,
    pieces: Pieces,
    shares: Floats,
    bends: Flags | None = None,
) -> Floats:
    """Return poses of the curve at the begin and at shares of each piece, shape (k, 1 + len(shares), 6).

    Args:
        bends: pieces in which the curve may be more than a parabola through begin, `MIDDLE` and end, shape (k,); None: all.
    """
    asked = np.ones((len(pieces.end), len(shares)), dtype=np.bool_)
    if bends is not None:
        asked = bends[:, None] | np.isin(shares, MIDDLE)
    found = curve.at(np.concatenate([[0.0], along(curve.toolpath, pieces, shares)[asked]]))
    at = np.empty((len(pieces.end), 1 + len(shares), 6))
    at[:, 1:][asked] = found[1:]
    at[:, 0] = np.vstack([found[0], at[:-1, -1]])
    if not asked.all():
        few = np.flatnonzero(~asked.all(axis=1))
        begin, middle, end = at[few, 0], at[few, 1 + int(np.argmax(shares == MIDDLE[0]))], at[few, -1]
        for column, share in enumerate(shares.tolist()):
            weights = (2.0 * share - 1.0) * (share - 1.0), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)
            at[few, 1 + column] = weights[0] * begin + weights[1] * middle + weights[2] * end
    return at


def looked_aside(curve: CommandCurve, pieces: Pieces, shares: Floats) -> Floats:
    """Return the commanded poses at shares of pieces, shape (n, k, 6), and let the curve go on from where it was."""
    behind, places = curve.behind, along(curve.toolpath, pieces, shares)
    at = curve.at(places.reshape(-1)).reshape(*places.shape, 6)
    curve.behind = behind
    return at


def _halved(curve: CommandCurve, cells: Pieces, shares: Floats, at: Floats, halves: Flags) -> Floats:
    if curve.has_history:
        return looked_at(curve, cells, shares)
    at[halves, 1:] = looked_aside(curve, Pieces(cells.begin[halves], cells.end[halves]), shares)
    at[1:, 0] = at[:-1, -1]
    return at


def along(toolpath: Toolpath, pieces: Pieces, shares: Floats) -> Floats:
    """Return positions at shares of the length of successive pieces, shape (k, len(shares))."""
    places = pieces.places(shares)
    across = np.flatnonzero(np.floor(pieces.begin) < pieces.row)
    if len(across):
        rows = np.arange(len(toolpath) + 1)
        behind_mm = np.concatenate([[0.0], np.cumsum(toolpath.tip_mm)])
        begin, end = (np.interp(each[across], rows, behind_mm) for each in (pieces.begin, pieces.end))
        inside = np.interp(begin[:, None] + (end - begin)[:, None] * shares, behind_mm, rows)
        places[across] = np.where(shares == 1.0, places[across], inside)
    return places


def _cells(
    curve: CommandCurve,
    model: MachineModel,
    tolerance_mm: float,
    whole: Flags,
) -> tuple[Pieces, Floats, Floats]:
    toolpath = curve.toolpath
    history = np.maximum(toolpath.tip_mm / HISTORY_MM, toolpath.turn_deg / HISTORY_DEG)
    cutting = np.maximum(toolpath.tip_mm / FIRST_CELL_MM, toolpath.turn_deg / FIRST_CELL_DEG)
    periods = _way_mm(toolpath, model.machine) / model.shortest_period_mm
    cutting = np.maximum(cutting, periods / OF_A_PERIOD)
    short = np.maximum(toolpath.tip_mm / SHORT_MM, toolpath.turn_deg / SHORT_DEG)
    long = (np.maximum(short, periods / SHORT_OF_A_PERIOD) > 1.0) & (toolpath.kind == RowKind.FEED)
    bends = long | whole | curve.has_history
    shares = LOOKED_AT if bends.any() else MIDDLE
    cells = _in(toolpath, np.where(whole, 1.0, np.where(toolpath.kind == RowKind.RAPID, history, cutting)))
    at = looked_at(curve, cells, shares, bends[cells.row])
    while True:
        row, share = cells.row, cells.end - cells.begin
        way_mm, turn_deg = share * toolpath.tip_mm[row], share * toolpath.turn_deg[row]
        can = (way_mm > SHORTEST_MM) | (turn_deg > SHORTEST_DEG)
        at_feed = (toolpath.kind[row] == RowKind.FEED) & curve.leads_on[row] & ~whole[row]
        bent = at_feed & can & (off_chord_mm(at, shares) > tolerance_mm / FINER)
        if not bent.any():
            return cells, at, shares
        _check_number(toolpath, len(row) + int(bent.sum()))
        again = 1 + bent.astype(np.int64)
        part, within = in_pieces(again)
        width = (cells.end - cells.begin)[part]
        begin = cells.begin[part] + width * (within - 1.0 / again[part])
        cells = Pieces(begin, np.where(within == 1.0, cells.end[part], cells.begin[part] + width * within))
        at = _halved(curve, cells, shares, at[part], again[part] > 1)


def _in(toolpath: Toolpath, number: Floats) -> Pieces:
    number = np.maximum(np.ceil(number), 1.0)
    _check_number(toolpath, number.sum())
    row, end = in_pieces(number.astype(np.int64))
    return Pieces(row + (end - 1.0 / number[row]), row + end)


def _way_mm(toolpath: Toolpath, machine: Machine) -> Floats:
    """Return an upper bound of the motion of tool tip and platform joints in each row, shape (n,) [mm].

    The platform turns by at most the sum of the three angles, which is at most √3 times their root sum of squares.
    """
    reach_mm = float(np.linalg.norm(machine.hexapod.platform_joints_mm, axis=1).max())
    return toolpath.tip_mm + math.sqrt(3.0) * reach_mm * np.radians(toolpath.turn_deg)


def _check_number(toolpath: Toolpath, cells: float) -> None:
    if cells > MOST_CELLS:
        what = f"the path is too long to be compensated at once: {cells:.0f} pieces, at most {MOST_CELLS}"
        raise StationError(what, where=toolpath.name, remedy="compensate it in parts, or allow a larger chord error")


@compiled
def _distance_mm(way: Floats, curve: Floats, start: int, end: int) -> float:
    worst = 0.0
    length = way[end] - way[start]
    for k in range(start + 1, end):
        share = (way[k] - way[start]) / length
        moved = turned = 0.0
        for axis in range(3):
            off = curve[k, axis] - curve[start, axis] - share * (curve[end, axis] - curve[start, axis])
            moved += off * off
        for axis in range(3, 6):
            off = curve[k, axis] - curve[start, axis] - share * (curve[end, axis] - curve[start, axis])
            turned += off * off
        worst = max(worst, moved, turned)
    return float(np.sqrt(worst))


@compiled
def longest(way: Floats, curve: Floats, may_end: Flags, must_end: Flags, tolerance_mm: float) -> Integers:
    """Return the ends of pieces, each as long as the tolerance allows.

    Args:
        way: of the places that pieces may join, shape (n,).
        curve: the commands there, shape (n, 6) [mm].
        may_end: where pieces may end, shape (n,).
        must_end: where they end in any case, shape (n,); the last place is one.
        tolerance_mm: from a place to the point of its piece at the same share of the way.
    """
    count = len(way)
    ended = np.zeros(count, np.int64)
    start = pieces = 0
    while start < count - 1:
        found = 0
        for end in range(start + 1, count):
            if not (may_end[end] or must_end[end]):
                continue
            if found > 0 and _distance_mm(way, curve, start, end) > tolerance_mm:
                break
            found = end
            if must_end[end]:
                break
        ended[pieces] = found
        pieces += 1
        start = found
    return ended[:pieces]
