"""Compensation of any toolpath: the machine model inverted over the whole path, long moves split where they bend."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.model.compensation import compensated
from dbbstation.nc.toolpath import Step, Toolpath, in_pieces, rounded
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.model.machine_model import MachineModel

CHORD_MM = 1e-4
"""Greatest distance between the straight commanded move and the curve that would take the tool exactly along the
straight wanted one: 0.1 µm, a tenth of what a ball bar repeats."""

LEVER_MM = 100.0
"""The tilt between points may be off by as much as moves a point this far from the tool tip by the chord error."""

FIRST_PIECE_MM, FIRST_PIECE_DEG = 50.0, 5.0
"""Moves are looked at in pieces of at most this size before any is halved."""

SHORTEST_MM, SHORTEST_DEG = 0.05, 0.01
"""Pieces are not halved below this: a step of the correction (backlash at a strut's reversal) has no chord that fits,
and is placed within this distance."""

HISTORY_MM, HISTORY_DEG = 5.0, 1.0
"""Steps in which rapids are followed for the sake of backlash and friction; they are written as one move all the same,
since nothing is cut on the way."""

FEED_KEPT = 1e-3
"""A feed stays as it is while the compensated move is as long as the wanted one within this share."""


@dataclass(frozen=True, eq=False)
class Compensation:
    """A compensated toolpath and what was done to it.

    Attributes:
        toolpath: poses rounded as they will be written.
        greatest_um: largest shift of a programmed point [µm].
        chord_um: largest distance found between a commanded move and the curve that it stands for [µm]; None where
            moves were not split.
    """

    toolpath: Toolpath
    greatest_um: float
    chord_um: float | None


def compensate_toolpath(
    toolpath: Toolpath,
    model: MachineModel,
    *,
    chord_mm: float | None = CHORD_MM,
    started_s: float | None = None,
) -> Compensation:
    """Return the toolpath that takes the actual machine along the given one.

    The whole path is inverted at once, rapids included, so that sources with a history see the one that the machine
    will have.

    Args:
        toolpath: as it should be.
        model: calibrated model; what belongs to the machine is inverted.
        chord_mm: moves at feed are split until they keep this tolerance; None writes one move for each.
        started_s: start of the program on the time scale of the model's sessions, for sources that need time [s];
            None: not known.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        ModelError: a source needs what a program does not give, such as temperatures, or the time where it is None.
    """
    pieces = _first_pieces(toolpath, chord_mm)
    while True:
        commanded, off_mm = _inverted(toolpath, pieces, model, started_s)
        if chord_mm is None:
            break
        bent = (off_mm > chord_mm) & _can_be_halved(toolpath, pieces)
        if not bent.any():
            break
        pieces = pieces.halved(bent)
    shift_mm = np.linalg.norm((commanded - toolpath.between(pieces.row, pieces.end))[:, :3], axis=1)
    return Compensation(
        toolpath=_assembled(toolpath, pieces, commanded),
        greatest_um=1e3 * float(np.nan_to_num(shift_mm).max(initial=0.0)),
        chord_um=None if chord_mm is None else 1e3 * float(off_mm.max(initial=0.0)),
    )


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Rows in pieces: the row of each piece, and the shares of the row where it begins and ends, shapes (k,)."""

    row: NDArray[np.int64]
    begin: NDArray[np.float64]
    end: NDArray[np.float64]

    def halved(self, which: NDArray[np.bool_]) -> _Pieces:
        """Return the pieces with some of them cut in two."""
        again = 1 + which.astype(np.int64)
        part, share = in_pieces(again)
        begin, width = self.begin[part], (self.end - self.begin)[part]
        return _Pieces(self.row[part], begin + width * (share - 1.0 / again[part]), begin + width * share)


def _first_pieces(toolpath: Toolpath, chord_mm: float | None) -> _Pieces:
    history = np.maximum(toolpath.tip_mm / HISTORY_MM, toolpath.turn_deg / HISTORY_DEG)
    cutting = np.maximum(toolpath.tip_mm / FIRST_PIECE_MM, toolpath.turn_deg / FIRST_PIECE_DEG)
    if chord_mm is None:
        cutting = np.ones(len(toolpath))
    count = np.where(toolpath.kind == Step.RAPID, history, cutting)
    number = np.maximum(np.ceil(count), 1.0).astype(np.int64)
    row, end = in_pieces(number)
    return _Pieces(row, end - 1.0 / number[row], end)


def _inverted(
    toolpath: Toolpath,
    pieces: _Pieces,
    model: MachineModel,
    started_s: float | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Poses to command at the ends of all pieces, shape (k, 6), and how far each piece passes its middle, shape (k,).

    Rows that do not move take over the pose before them; NaN before the machine's place is known.
    """
    goes_anywhere = (toolpath.tip_mm > 0.0) | (toolpath.turn_deg > 0.0)
    known = ~np.isnan(toolpath.before[pieces.row][:, 0])
    goes = known & goes_anywhere[pieces.row]
    # In time order: where the machine stands first, then middle and end of every piece that leads somewhere.
    first = int(np.argmax(known))
    taken = np.repeat(goes, 2)
    share = np.stack([(pieces.begin + pieces.end) / 2.0, pieces.end], axis=1).reshape(-1)[taken]
    row = np.repeat(pieces.row, 2)[taken]
    path = np.vstack([toolpath.before[pieces.row[first]], toolpath.between(row, share)])
    time_s = None
    if started_s is not None:
        begin_s = toolpath.end_s - toolpath.duration_s
        node_s = begin_s[row] + share * toolpath.duration_s[row]
        time_s = started_s + np.concatenate([begin_s[pieces.row[first]][None], node_s])
    inverse = compensated(model, Motion(poses=path, is_path=True, time_s=time_s))
    place = np.cumsum(taken).reshape(-1, 2)
    commanded = np.where(known[:, None], inverse[place[:, 1]], np.nan)
    before, middle = inverse[place[:, 0] - 1], inverse[place[:, 0]]
    at_feed = goes & (toolpath.kind[pieces.row] == Step.FEED)
    return commanded, np.where(at_feed, _passed_mm(before, middle, commanded), 0.0)


def _passed_mm(
    before: NDArray[np.float64],
    middle: NDArray[np.float64],
    after: NDArray[np.float64],
) -> NDArray[np.float64]:
    """How far straight moves from `before` to `after` pass the poses that their middles need, shape (k,) [mm]."""
    off = middle - (before + after) / 2.0
    tilted_mm = LEVER_MM * np.radians(np.linalg.norm(off[:, 3:], axis=1))
    return np.maximum(np.linalg.norm(off[:, :3], axis=1), tilted_mm)


def _can_be_halved(toolpath: Toolpath, pieces: _Pieces) -> NDArray[np.bool_]:
    share = pieces.end - pieces.begin
    long: NDArray[np.bool_] = (share * toolpath.tip_mm[pieces.row] > SHORTEST_MM) | (
        share * toolpath.turn_deg[pieces.row] > SHORTEST_DEG
    )
    return long


def _assembled(toolpath: Toolpath, pieces: _Pieces, commanded: NDArray[np.float64]) -> Toolpath:
    """The toolpath with one row for each piece, rapids in one."""
    last = np.append(pieces.row[1:] != pieces.row[:-1], True)
    written = last | (toolpath.kind[pieces.row] == Step.FEED)
    row = pieces.row[written]
    place = {int(old): new for new, old in enumerate(row) if int(old) in toolpath.text}
    bare = replace(
        toolpath,
        kind=toolpath.kind[row],
        poses=rounded(commanded[written]),
        feed_mm_min=toolpath.feed_mm_min[row],
        dwell_s=toolpath.dwell_s[row],
        line=toolpath.line[row],
        text=MappingProxyType({place[old]: text for old, text in toolpath.text.items()}),
    )
    share = (pieces.end - pieces.begin)[written]
    return replace(bare, feed_mm_min=_feeds(bare, share * toolpath.tip_mm[row], share * toolpath.duration_s[row]))


def _feeds(path: Toolpath, wanted_mm: NDArray[np.float64], wanted_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Feeds of a compensated path, shape (n,).

    The feed is that of the tool tip in X, Y and Z, and the compensated move has the wanted length within a few
    parts in ten thousand, so F stays. Not so where the platform turns about a tool tip that hardly moves: there the
    correction is most of the way, and the old F would run it in no time. Such moves get the feed that takes the
    wanted time.
    """
    # Controls take F for a turning speed only where X, Y and Z stand still to the last digit.
    way = np.where(path.tip_mm > 0.0, path.tip_mm, path.turn_deg)
    like = (path.tip_mm > 0.0) == (wanted_mm > 0.0)
    wanted = np.where(wanted_mm > 0.0, wanted_mm, way)
    kept = like & (np.abs(way - wanted) <= FEED_KEPT * wanted)
    in_time = np.divide(60.0 * way, wanted_s, out=path.feed_mm_min.copy(), where=(wanted_s > 0.0) & (way > 0.0))
    return np.where((path.kind == Step.FEED) & ~kept, in_time, path.feed_mm_min)
