"""Check that a compensated program keeps chord error and feed, and state what a preference costs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.nc.compensate import Prefer
from dbbstation.nc.planner import KEPT
from dbbstation.nc.toolpath import RowKind

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.nc.compensate import Compensation, Slow

CHOICES = "--prefer accuracy (slower), feed (less accurate) or position-only (A, B and C as they are)"

LEVER = "100 mm from the tip"


class TooSlowError(StationError):
    """The control cannot keep a feed.

    Args:
        prefer: None: nothing was preferred.
    """

    def __init__(self, name: str, slow: Slow, asked_um: float, machine: Machine, prefer: Prefer | None) -> None:
        self._about = name, slow, asked_um, machine, prefer
        self.reached_mm_min = slow.reached_mm_min
        within = f" within {asked_um:g} µm" if prefer is None else f" with --prefer {prefer.value} either"
        reached = math.floor(slow.reached_mm_min)
        ways = [f"give F{reached} or less"] if reached >= 1 else []
        if prefer is None and not math.isnan(slow.chord_um) and slow.chord_um > asked_um:
            ways.append(f"--chord-um {up(slow.chord_um / 0.95)}")
        ways.append(CHOICES if prefer is None else f"--prefer {Prefer.ACCURACY.value}")
        super().__init__(
            f"F{slow.asked_mm_min:g} cannot be kept{within}: the control reaches {f'F{reached}' if reached >= 1 else 'no F'} here, "
            f"with {said_acceleration(machine)}",
            where=where(name, slow.line),
            remedy=", or ".join(ways),
        )

    def reaching(self, mm_min: float) -> TooSlowError:
        """Return the error with another reachable feed [mm/min]."""
        name, slow, asked_um, machine, prefer = self._about
        return TooSlowError(name, replace(slow, reached_mm_min=mm_min), asked_um, machine, prefer)


class MergedMovesError(StationError):
    """Each move keeps its feed, but the control merges short moves of the nominal program and is faster there.

    Args:
        merged_um: distance of merged points from their line.
    """

    def __init__(self, refused: TooSlowError, merged_um: float) -> None:
        super().__init__(
            f"the control makes short moves of this program one, within {up(merged_um)} µm (G64 P Q; P without Q), and is slower "
            "through each of them",
            where=refused.where,
            remedy=f"write Q0 behind P to have each of them, --prefer {Prefer.ACCURACY.value} has each and takes longer, "
            f"--prefer {Prefer.FEED.value} and {Prefer.POSITION_ONLY.value} make them one as well",
        )


def check_chord(
    name: str, done: Compensation, asked_um: float, accepted_um: float | None, prefer: Prefer | None
) -> None:
    """Refuse a program that leaves the path by more than requested, unless a larger error was accepted.

    Even if the feed is preferred, the chord error must stay below the correction.

    Raises:
        StationError: names the line and what is reached.
    """
    if done.chord_um <= max(asked_um, accepted_um or 0.0):
        return
    if prefer is Prefer.FEED:
        if done.chord_um < done.greatest_um:
            return
        raise StationError(
            f"in pieces that keep the feed the path is off by {up(done.chord_um)} µm here, and the model corrects "
            f"{up(done.greatest_um)} µm at most",
            where=where(name, done.chord_line),
            remedy=f"give a smaller F, or --prefer {Prefer.ACCURACY.value}; --accept-chord-um {up(done.chord_um)} writes it so",
        )
    raise StationError(
        f"the path is kept within {up(done.chord_um)} µm here, not within {asked_um:g} µm: the correction has a step, or bends "
        "more than the shortest pieces follow",
        where=where(name, done.chord_line),
        remedy=f"accept it with --accept-chord-um {up(done.chord_um)}, or give a --chord-um that can be kept",
    )


def check_feed(name: str, done: Compensation, asked_um: float, machine: Machine, prefer: Prefer | None) -> None:
    """Refuse a program slower than its original, unless that was preferred.

    Raises:
        StationError: names the line and the feed that can be reached.
    """
    if done.slow is not None and prefer is not Prefer.ACCURACY:
        raise TooSlowError(name, done.slow, asked_um, machine, prefer)


def said_acceleration(machine: Machine) -> str:
    """Return the assumed acceleration, and whether the machine file states it."""
    known = "" if machine.acceleration_mm_s2 is not None else " (the machine file has no `acceleration_mm_s2`)"
    return f"{machine.planned_acceleration_mm_s2 / 1e3:g} m/s²{known}"


def cost(done: Compensation, asked_um: float, prefer: Prefer) -> str:
    """Return what a preference costs, in µm and seconds."""
    slower = f"{max(done.seconds - done.nominal_seconds, 0.0):.1f} s more than {done.nominal_seconds:.1f} s at feed"
    if prefer is Prefer.ACCURACY:
        return f"--prefer accuracy costs {slower}"
    if prefer is Prefer.FEED:
        return f"--prefer feed costs a chord error of {up(done.chord_um)} µm in place of {asked_um:g} µm, and {slower}"
    return f"--prefer position-only leaves a tilt that is felt as {up(done.tilt_um)} µm {LEVER}, and costs {slower}"


def slower_rapids(done: Compensation) -> str:
    """Return what rapids lose, in words; empty if they or the whole program keep `KEPT` of their time."""
    takes, took = done.rapid_seconds, done.nominal_rapid_seconds
    if takes <= KEPT * took or takes + done.seconds <= KEPT * (took + done.nominal_seconds):
        return ""
    told = f"rapids are reckoned to take {takes:.1f} s in place of {took:.1f} s, since A, B and C are corrected in them"
    path = done.toolpath
    if np.isfinite(path.corners_mm[path.kind == RowKind.RAPID]).all():
        return told
    return (
        f"{told}: where the program says how far corners may be rounded, as with G64 P0.05, they lose next to nothing"
    )


def merged_moves(merged_um: float) -> str:
    """Return the cost of merging short moves, in words."""
    return (
        f"short moves are made one within {up(merged_um)} µm, as the control makes those of the nominal program under G64 P Q "
        "(P without Q); Q0 would keep each of them"
    )


def where(name: str, line: int) -> str:
    """Return the place of a line in a program."""
    return f"{name}:{line}" if line else name


def up(value: float) -> str:
    """A number with two digits, rounded up."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.4g}"
