"""Compensation of any toolpath: the machine model inverted over the whole path, long moves split where they bend."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.model.compensation import compensated
from dbbstation.nc.limits import LARGEST_CORRECTION_MM
from dbbstation.nc.toolpath import Step, Toolpath, in_pieces, rounded
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel

CHORD_MM = 1e-4
"""Greatest distance between the straight commanded move and the curve that would take the tool exactly along the
straight wanted one: 0.1 µm, a tenth of what a ball bar repeats."""

LEVER_MM = 100.0
"""The tilt between points may be off by as much as moves a point this far from the tool tip by the chord error."""

FIRST_PIECE_MM, FIRST_PIECE_DEG = 50.0, 5.0
"""Moves are looked at in pieces of at most this size before any is halved."""

OF_A_PERIOD = 0.25
"""Before any is halved, pieces are at most this share of the shortest period in the model: start, middle and end of a longer
one can all lie on the zeros of a wave. On 150 lines with drawn screw errors the worst place was 2.0 µm off without this,
0.11 µm with the whole period or half of it, 0.10 µm with a quarter or a tenth [docs/nc.md]."""

LOOKED_AT = (0.19, 0.5, 0.73)
"""Shares of a piece at which its distance from the curve is taken: not evenly spaced, so that no wave is met at its
zeros each time. With the middle alone the same lines were 0.27, 0.23 and 0.12 µm off with a period, a half, a quarter."""

MOST_PIECES = 1_000_000
"""All pieces are inverted at once; so many take some gigabytes and minutes. As many as `rs274.reader.MOST_ROWS`."""

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
        greatest_um: largest shift of a programmed point, or of one `LEVER_MM` from the tip by the tilt [µm].
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
    largest_mm: float = LARGEST_CORRECTION_MM,
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
        largest_mm: greatest correction that is applied, of the tip and of a point `LEVER_MM` from it by the tilt [mm].

    Raises:
        KinematicsError: a pose that the machine cannot take.
        StationError: a correction is larger than that, or the path has too many pieces.
        ModelError: a source needs what a program does not give, such as temperatures, or the time where it is None.
    """
    pieces = _first_pieces(toolpath, chord_mm, model)
    while True:
        commanded, off_mm = _inverted(toolpath, pieces, model, started_s)
        shift_mm = _felt_mm(commanded - toolpath.between(pieces.row, pieces.end))
        _check_corrections(toolpath, pieces, shift_mm, largest_mm)
        if chord_mm is None:
            break
        bent = (off_mm > chord_mm) & _can_be_halved(toolpath, pieces)
        if not bent.any():
            break
        _check_number(toolpath, len(pieces.row) + int(bent.sum()))
        pieces = pieces.halved(bent)
    return Compensation(
        toolpath=_assembled(toolpath, pieces, commanded, model.machine),
        greatest_um=1e3 * float(shift_mm.max(initial=0.0)),
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


def _first_pieces(toolpath: Toolpath, chord_mm: float | None, model: MachineModel) -> _Pieces:
    history = np.maximum(toolpath.tip_mm / HISTORY_MM, toolpath.turn_deg / HISTORY_DEG)
    cutting = np.maximum(toolpath.tip_mm / FIRST_PIECE_MM, toolpath.turn_deg / FIRST_PIECE_DEG)
    cutting = np.maximum(cutting, _way_mm(toolpath, model.machine) / (OF_A_PERIOD * model.shortest_period_mm))
    if chord_mm is None:
        cutting = np.ones(len(toolpath))
    number = np.maximum(np.ceil(np.where(toolpath.kind == Step.RAPID, history, cutting)), 1.0)
    _check_number(toolpath, number.sum())
    row, end = in_pieces(number.astype(np.int64))
    return _Pieces(row, end - 1.0 / number[row], end)


def _way_mm(toolpath: Toolpath, machine: Machine) -> NDArray[np.float64]:
    """Bound of the way of the tool tip and of every platform joint in each row, which bounds a strut's, shape (n,) [mm].

    The platform turns by the three angles one after the other: by their sum at most, √3 times the root of their squares.
    """
    reach_mm = float(np.linalg.norm(machine.hexapod.platform_joints_mm, axis=1).max())
    return toolpath.tip_mm + math.sqrt(3.0) * reach_mm * np.radians(toolpath.turn_deg)


def _check_number(toolpath: Toolpath, pieces: float) -> None:
    if pieces > MOST_PIECES:
        what = f"the path is too long to be compensated at once: {pieces:.0f} pieces, at most {MOST_PIECES}"
        raise StationError(what, where=toolpath.name, remedy="compensate it in parts, or allow a larger chord error")


def _check_corrections(toolpath: Toolpath, pieces: _Pieces, shift_mm: NDArray[np.float64], largest_mm: float) -> None:
    """Refuse corrections that no machine needs."""
    if shift_mm.max(initial=0.0) <= largest_mm:
        return
    worst = int(np.argmax(shift_mm))
    line = int(toolpath.line[pieces.row[worst]])
    raise StationError(
        f"the model asks for a correction of {shift_mm[worst]:.3f} mm here, more than {largest_mm:g} mm",
        where=f"{toolpath.name}:{line}" if line else toolpath.name,
        remedy="check that the model is of this machine and its values are right; a machine that is that far off needs "
        "--largest-correction-mm",
    )


def _inverted(
    toolpath: Toolpath,
    pieces: _Pieces,
    model: MachineModel,
    started_s: float | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Poses to command at the ends of all pieces, shape (k, 6), and how far each passes the curve, shape (k,) [mm].

    Rows that do not move take over the pose before them; NaN before the machine's place is known.
    """
    goes_anywhere = (toolpath.tip_mm > 0.0) | (toolpath.turn_deg > 0.0)
    known = ~np.isnan(toolpath.before[pieces.row][:, 0])
    goes = known & goes_anywhere[pieces.row]
    # In time order: where the machine stands first, then the places in every piece that leads somewhere, its end last.
    first = int(np.argmax(known))
    inside = np.append(LOOKED_AT, 1.0)
    taken = np.repeat(goes, len(inside))
    share = (pieces.begin[:, None] + (pieces.end - pieces.begin)[:, None] * inside).reshape(-1)[taken]
    share[len(inside) - 1 :: len(inside)] = pieces.end[goes]
    row = np.repeat(pieces.row, len(inside))[taken]
    path = np.vstack([toolpath.before[pieces.row[first]], toolpath.between(row, share)])
    time_s = None
    if started_s is not None:
        begin_s = toolpath.end_s - toolpath.duration_s
        node_s = begin_s[row] + share * toolpath.duration_s[row]
        time_s = started_s + np.concatenate([begin_s[pieces.row[first]][None], node_s])
    inverse = compensated(model, Motion(poses=path, is_path=True, time_s=time_s))
    place = np.cumsum(taken).reshape(-1, len(inside))
    commanded = np.where(known[:, None], inverse[place[:, -1]], np.nan)
    before = inverse[place[:, 0] - 1]
    at_feed = goes & (toolpath.kind[pieces.row] == Step.FEED)
    passed = [
        _felt_mm(inverse[place[:, k]] - (before + part * (commanded - before))) for k, part in enumerate(LOOKED_AT)
    ]
    return commanded, np.where(at_feed, np.max(passed, axis=0), 0.0)


def _felt_mm(off: NDArray[np.float64]) -> NDArray[np.float64]:
    """What differences of poses, shape (k, 6), are at the tip or, where more, by their tilt at the lever, (k,) [mm].

    Zero where a place is not known.
    """
    tilted_mm = LEVER_MM * np.radians(np.linalg.norm(off[:, 3:], axis=1))
    felt: NDArray[np.float64] = np.nan_to_num(np.maximum(np.linalg.norm(off[:, :3], axis=1), tilted_mm))
    return felt


def _can_be_halved(toolpath: Toolpath, pieces: _Pieces) -> NDArray[np.bool_]:
    share = pieces.end - pieces.begin
    long: NDArray[np.bool_] = (share * toolpath.tip_mm[pieces.row] > SHORTEST_MM) | (
        share * toolpath.turn_deg[pieces.row] > SHORTEST_DEG
    )
    return long


def _assembled(toolpath: Toolpath, pieces: _Pieces, commanded: NDArray[np.float64], machine: Machine) -> Toolpath:
    """The toolpath with one row for each piece, rapids in one."""
    last = np.append(pieces.row[1:] != pieces.row[:-1], True)
    written = last | (toolpath.kind[pieces.row] == Step.FEED)
    row = pieces.row[written]
    bare = toolpath.divided(row, rounded(commanded[written]))
    share = (pieces.end - pieces.begin)[written]
    feed = _feeds(bare, toolpath.feed[row], share * toolpath.tip_mm[row], share * toolpath.duration_s[row])
    # A wanted move that takes no time at all, as a turn with a few nanometres of way, has no such feed: the machine's own
    # limits are what slows it down, whatever F says.
    return replace(
        bare,
        feed_mm_min=np.where(bare.only_turns, bare.feed_mm_min, np.minimum(feed, machine.feed_limit_mm_min)),
        feed_deg_min=np.where(bare.only_turns, np.minimum(feed, machine.turn_limit_deg_min), bare.feed_deg_min),
    )


def _feeds(
    path: Toolpath,
    wanted_feed: NDArray[np.float64],
    wanted_mm: NDArray[np.float64],
    wanted_s: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Feeds of a compensated path, shape (n,): of the tool tip [mm/min], of the angles where it stands still [deg/min].

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
    in_time = np.divide(60.0 * way, wanted_s, out=wanted_feed.copy(), where=(wanted_s > 0.0) & (way > 0.0))
    return np.where((path.kind == Step.FEED) & ~kept, in_time, wanted_feed)
