"""Compensate any toolpath: invert the model along the path, in pieces that keep chord error and feed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.nc.curve import CommandCurve, felt_mm, row_and_share
from dbbstation.nc.limits import CHORD_MM, LARGEST_CORRECTION_MM
from dbbstation.nc.planner import LOOKS_AHEAD, cuts
from dbbstation.nc.splitting import (
    Pieces,
    looked_aside,
    looked_at,
    off_chord_mm,
    parts_of,
    runs_of,
    split,
)
from dbbstation.nc.toolpath import RowKind, rounded

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.nc.curve import Behind
    from dbbstation.nc.planner import Planner
    from dbbstation.nc.toolpath import Toolpath

DENSELY = np.arange(1, 14) / 13.0
"""Shares of a piece at which its distance from the curve is computed. The number of parts is prime, so that a wave is
not sampled at its zeros only."""

FEED_KEPT = 1e-3
"""A feed stays unchanged if the lengths of compensated and wanted move differ by at most this share."""


class Prefer(StrEnum):
    """What is corrected."""

    ACCURACY = "accuracy"
    """All six axes. In short pieces a control may be slower than F."""
    POSITION_ONLY = "position-only"
    """The tool tip only: A, B and C stay as programmed, without correction."""


@dataclass(frozen=True, eq=False)
class Compensation:
    """A compensated toolpath with its largest corrections and errors.

    Attributes:
        greatest_um: largest shift of a programmed point, or of one `LEVER_MM` from the tip by the tilt [µm].
        chord_um: largest distance between a commanded move and its curve, at `DENSELY` places of each piece [µm].
        chord_line: 0 if none.
        tilt_um: largest tilt correction left out, at `LEVER_MM` [µm].
        seconds: time in moves at feed, as the planner computes it.
        slowest_mm_min: F at which no piece is too short; infinite if all keep their feed.
        slowest_line: line of the piece that needs this F; 0 if none.
    """

    toolpath: Toolpath
    greatest_um: float
    chord_um: float
    chord_line: int
    tilt_um: float
    seconds: float
    nominal_seconds: float
    slowest_mm_min: float
    slowest_line: int

    @classmethod
    def together(cls, parts: Sequence[Compensation], toolpath: Toolpath) -> Compensation:
        """Return the figures of successive parts as the figures of one toolpath."""
        farthest, slowest = max(parts, key=lambda part: part.chord_um), min(parts, key=lambda part: part.slowest_mm_min)
        return cls(
            toolpath,
            max(part.greatest_um for part in parts),
            farthest.chord_um,
            farthest.chord_line,
            max(part.tilt_um for part in parts),
            sum(part.seconds for part in parts),
            sum(part.nominal_seconds for part in parts),
            slowest.slowest_mm_min,
            slowest.slowest_line,
        )


def compensated_parts(
    toolpath: Toolpath,
    model: MachineModel,
    *,
    chord_mm: float = CHORD_MM,
    keep_arcs: bool = False,
    started_s: float | None = None,
    largest_mm: float = LARGEST_CORRECTION_MM,
    planner: Planner = LOOKS_AHEAD,
    prefer: Prefer = Prefer.ACCURACY,
) -> Iterator[Compensation]:
    """Yield, part by part, the toolpath that moves the actual machine along the given one.

    Args:
        model: calibrated; only sources of the machine are inverted.
        chord_mm: tolerance of the longest pieces.
        keep_arcs: keep the chords of arcs, chosen earlier for the feed.
        started_s: start of the program on the time scale of the model's sessions; None: unknown.
        largest_mm: greatest correction of the tip, and of a point `LEVER_MM` from it by the tilt.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        StationError: a correction exceeds `largest_mm`, or the path has too many pieces.
        ModelError: a source needs data that a program lacks, such as temperatures, or the time if `started_s` is None.
    """
    before: Behind | None = None
    commanded_before = toolpath.start

    def runs_in(part: Toolpath) -> Integers:
        return runs_of(part, planner.needed_mm(np.where(cuts(part), np.nan_to_num(part.feed) / 60.0, 0.0)))

    for path, runs in parts_of(toolpath, runs_in):
        whole = keep_arcs & (path.rows["arc_number"] != 0)
        curve = CommandCurve(path, model, started_s, hold_tilt=prefer is Prefer.POSITION_ONLY, before=before)
        pieces, commanded, off_mm = _commanded(curve, model, chord_mm, runs, whole)
        shift_mm = felt_mm(commanded - path.between(*row_and_share(pieces.end)))
        _check_corrections(path, pieces, shift_mm, largest_mm)
        off_mm = np.where(path.kind[pieces.row] == RowKind.FEED, off_mm, 0.0)
        corner_mm = 0.0 if keep_arcs else max(chord_mm, float(off_mm.max(initial=0.0)))
        done = _assembled(path, pieces, commanded, runs, model.machine, corner_mm, commanded_before)
        worst = int(np.argmax(off_mm)) if len(off_mm) else 0
        too_short = planner.row_mm_s(done) * 60.0
        too_short = np.where(too_short < (1.0 - FEED_KEPT) * done.feed, too_short, np.inf)
        slowest = float(too_short.min(initial=np.inf))
        yield Compensation(
            toolpath=done,
            greatest_um=1e3 * float(shift_mm.max(initial=0.0)),
            chord_um=1e3 * float(off_mm.max(initial=0.0)),
            chord_line=int(path.line[pieces.row[worst]]) if len(off_mm) else 0,
            tilt_um=1e3 * curve.tilt_left_mm,
            seconds=planner.seconds(done),
            nominal_seconds=planner.seconds(path),
            slowest_mm_min=slowest,
            slowest_line=int(done.line[int(np.argmin(too_short))]) if np.isfinite(slowest) else 0,
        )
        before, commanded_before = curve.behind, done.poses[-1] if len(done) else commanded_before
        started_s = None if started_s is None else started_s + float(path.duration_s.sum())


def _commanded(
    curve: CommandCurve,
    model: MachineModel,
    chord_mm: float,
    runs: Integers,
    whole: Flags,
) -> tuple[Pieces, Floats, Floats]:
    """Return pieces, poses to command at their ends, shape (k, 6) [mm, deg], and the curve's distance from them, shape (k,) [mm]."""
    pieces, ends, off_mm = split(curve, model, chord_mm, runs, whole=whole)
    if curve.has_history:
        at = looked_at(curve, pieces, DENSELY)
        return pieces, at[:, -1], off_chord_mm(at, DENSELY)
    some = np.flatnonzero(np.isnan(off_mm))
    if len(some):
        inner = looked_aside(curve, Pieces(pieces.begin[some], pieces.end[some]), DENSELY[:-1])
        at = np.concatenate([ends[some, :1], inner, ends[some, 1:]], axis=1)
        off_mm[some] = off_chord_mm(at, DENSELY)
    return pieces, ends[:, 1], off_mm


def _check_corrections(toolpath: Toolpath, pieces: Pieces, shift_mm: Floats, largest_mm: float) -> None:
    if shift_mm.max(initial=0.0) <= largest_mm:
        return
    worst = int(np.argmax(shift_mm))
    raise StationError(
        f"the model asks for a correction of {shift_mm[worst]:.3f} mm here, more than {largest_mm:g} mm",
        where=toolpath.where(int(pieces.row[worst])),
        remedy="check that the model is of this machine and its values are right; for a machine with such large errors, give --largest-correction-mm",
    )


def _assembled(
    toolpath: Toolpath,
    pieces: Pieces,
    commanded: Floats,
    runs: Integers,
    machine: Machine,
    corner_mm: float,
    start: Floats | None,
) -> Toolpath:
    row = pieces.row
    of = runs[row]
    begin_mm, begin_s = _until(toolpath, pieces.begin)
    end_mm, end_s = _until(toolpath, pieces.end)
    # Rapids stay one move.
    written = np.append(row[1:] != row[:-1], True)[: len(row)] | (toolpath.kind[row] == RowKind.FEED)
    bare = replace(toolpath.divided(row[written], rounded(commanded[written])), start=start)
    inner = np.append(of[1:] == of[:-1], False)[: len(row)][written]
    feed = _feeds(bare, toolpath.feed[row[written]], (end_mm - begin_mm)[written], (end_s - begin_s)[written])
    # A wanted move that takes no time at all, as a turn with a few nanometres of way, has no such feed: the machine's own
    # limits are what slows it down, whatever F says.
    return bare.changed(
        corners_mm=np.where(inner, np.fmax(bare.corners_mm, corner_mm), bare.corners_mm),
        feed_mm_min=np.where(bare.only_turns, bare.feed_mm_min, np.minimum(feed, machine.feed_limit_mm_min)),
        feed_deg_min=np.where(bare.only_turns, np.minimum(feed, machine.turn_limit_deg_min), bare.feed_deg_min),
    )


def _until(toolpath: Toolpath, places: Floats) -> tuple[Floats, Floats]:
    at = np.arange(len(toolpath) + 1)
    ways = (np.concatenate([[0.0], np.cumsum(each)]) for each in (toolpath.tip_mm, toolpath.duration_s))
    way_mm, time_s = (np.interp(places, at, way) for way in ways)
    return way_mm, time_s


def _feeds(
    path: Toolpath,
    wanted_feed: Floats,
    wanted_mm: Floats,
    wanted_s: Floats,
) -> Floats:
    """Return the feeds of a compensated path, shape (n,) [mm/min]; of angles if the tip does not move [deg/min].

    F is kept, because the compensated move has nearly the original length. If the tip hardly moves, the turn gets the
    feed that keeps its original time.
    """
    # Controls take F for a turning speed only where X, Y and Z stand still to the last digit.
    way = np.where(path.tip_mm > 0.0, path.tip_mm, path.turn_deg)
    like = (path.tip_mm > 0.0) == (wanted_mm > 0.0)
    wanted = np.where(wanted_mm > 0.0, wanted_mm, way)
    kept = like & (np.abs(way - wanted) <= FEED_KEPT * wanted)
    in_time = np.divide(60.0 * way, wanted_s, out=wanted_feed.copy(), where=(wanted_s > 0.0) & (way > 0.0))
    return np.where((path.kind == RowKind.FEED) & ~kept, in_time, wanted_feed)
