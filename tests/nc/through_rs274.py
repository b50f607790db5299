"""Whether a compensated program does what its nominal one does, both as LinuxCNC's interpreter reads them.

Nothing here is taken from our reader: the events of both are walked side by side. The compensated moves are put through the
machine model forward, which tells where the tool is, and must lie on the nominal line or arc and end where it ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate, groupby
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Motion
from tests.nc.interpreter import PLANES

if TYPE_CHECKING:
    from dbbstation.model.machine_model import MachineModel
    from tests.nc.interpreter import Event

MOVES = {"RAPID", "FEED", "ARC"}

PRINTED = 0.51e-4
"""Half the last decimal that the interpreter prints [mm, deg, in]."""

ROUNDINGS = 3
"""A place is the sum of three numbers that the interpreter prints: position, work offset and G92."""

CHORD_MM = 1.5e-4
"""The chord that was asked for, and what our own arcs add to it [mm]."""

LEVER_MM = 100.0
SCALE = np.array([1.0] * 3 + [math.radians(LEVER_MM)] * 3)
"""What a unit of each axis is worth, of an angle at a point so far from the tip [mm]."""

SHARE_OF_TIME = 2e-3
"""Compensated moves are as long as nominal ones within a part in a thousand, so their times are too."""

SHIFT_MM = 2.0
"""More than any correction of the models here."""


EXACT = "CANON_EXACT_PATH"


class DiffersError(AssertionError):
    """The two programs do not do the same."""


@dataclass(frozen=True)
class Group:
    """A nominal move and the compensated moves that stand for it."""

    wanted: Event
    done: list[Event]


def compare(wanted: list[Event], done: list[Event], model: MachineModel) -> list[Group]:
    """Walk both; return which moves belong together.

    Raises:
        DiffersError: they differ, with where.
    """
    return _Walk(wanted, done, model).groups()


def said(events: list[Event]) -> list[str]:
    """What happens beside the moves, in order; a row of moves is one word."""
    kinds = groupby(events, key=lambda event: "moves" if event.kind in MOVES else "")
    found: list[str] = []
    for kind, group in kinds:
        found += [kind] if kind else [_said(event) for event in group]
    return found


def _said(event: Event) -> str:
    if event.kind == "DWELL":
        return f"DWELL {event.dwell_s:.4f}"
    return event.said or event.kind


def _spoken(events: list[Event]) -> list[int]:
    others = accumulate(event.kind not in MOVES for event in events)
    return [count for count, event in zip(others, events, strict=True) if event.kind in MOVES]


class _Walk:
    def __init__(self, wanted: list[Event], done: list[Event], model: MachineModel) -> None:
        _same("what is said", said(wanted), said(done))
        self.wanted = [event for event in wanted if event.kind in MOVES]
        self.done = [event for event in done if event.kind in MOVES]
        self.spoken, self.spoken_done = _spoken(wanted), _spoken(done)
        commanded = np.array([event.pose for event in self.done])
        middle = commanded.copy()
        middle[1:] = (commanded[1:] + commanded[:-1]) / 2.0
        self.commanded = commanded
        self.tool = model.actual_poses(Motion(poses=commanded, is_path=True))
        self.middle = model.actual_poses(Motion(poses=middle, is_path=True))

    def groups(self) -> list[Group]:
        place, found = 0, []
        for index, event in enumerate(self.wanted):
            end = self._end_of(index, place)
            pieces = self.done[place:end]
            if not pieces and self._goes_on(index):
                found.append(Group(event, []))
                continue
            if not pieces:
                raise DiffersError(f"nothing stands for move {index} to {event.pose}")
            if {self.spoken[index]} != set(self.spoken_done[place:end]):
                raise DiffersError(f"move {index} stands between other words")
            kind = "FEED" if event.kind == "ARC" else event.kind
            _same(f"kind of move {index}", {kind}, {piece.kind for piece in pieces})
            # A bound where the program gives none is no harm, and between rapids a stop where the program has a bound.
            stops = event.kind == "RAPID" and pieces[-1].corner == EXACT
            if event.corner and not stops:
                _same(f"path control at the end of move {index}", event.corner, pieces[-1].corner)
            if event.corner == EXACT and any(piece.corner == event.corner for piece in pieces[:-1]):
                raise DiffersError(f"move {index} stops on its way")
            if index and event.kind != "RAPID":
                self._check_time(index, place, end)
            found.append(Group(event, pieces))
            place = end
        _same("number of moves", place, len(self.done))
        return found

    def _goes_on(self, index: int) -> bool:
        """Whether a rapid goes on in the next one, in the same direction, coordinate system and path control, with nothing said between them."""
        if not 0 < index < len(self.wanted) - 1:
            return False
        before, event, on = (self.wanted[i] for i in (index - 1, index, index + 1))
        first, second = event.pose - before.pose, on.pose - event.pose
        ways = first[:3] @ second[:3], np.linalg.norm(first[:3]) * np.linalg.norm(second[:3])
        straight = ways[1] > 0.0 and ways[0] > (1.0 - 1e-6) * ways[1] and not first[3:].any() and not second[3:].any()
        alike = (event.kind, event.corner) == (on.kind, on.corner)
        return bool(straight and alike and event.kind == "RAPID" and self.spoken[index] == self.spoken[index + 1])

    def _end_of(self, index: int, place: int) -> int:
        event = self.wanted[index]
        if event.kind == "RAPID" and self._goes_on(index):
            off = np.abs(self.tool[place] - event.pose)
            if off[:3].max() > 4.0 * PRINTED * (1.0 + event.unit_mm):
                return place  # it is written as one with the next
        if event.kind == "RAPID" or index == 0:
            return place + 1
        before = self.wanted[index - 1]
        self._check_on(before.pose, self.tool[place - 1], PRINTED * (1.0 + before.unit_mm), f"begin of move {index}")
        way = _Arc(before, event) if event.kind == "ARC" else _Line(before, event)
        slack = PRINTED * (1.0 + event.unit_mm) + PRINTED * before.unit_mm
        if event.kind == "ARC":  # its centre is printed, and the far side is off by twice as much
            slack += PRINTED * event.unit_mm
        for end in range(place, len(self.done)):
            for pose, name in ((self.middle[end], "middle"), (self.tool[end], "end")):
                there = way.nearest(pose)
                self._check_on(there, pose, slack + CHORD_MM, f"{name} of piece {end - place} of move {index}")
            if way.is_at_end(self.tool[end], ROUNDINGS * slack) and not self._comes_nearer(end, event):
                return end + 1
        raise DiffersError(f"move {index} does not reach {event.pose}")

    def _comes_nearer(self, end: int, event: Event) -> bool:
        """Whether the next piece ends nearer to the end of a move: in inches, the last piece may be as short as what is printed."""
        off_mm = np.linalg.norm((self.tool[end : end + 2] - event.pose) * SCALE, axis=1)
        return len(off_mm) > 1 and bool(off_mm[1] < off_mm[0]) and self.done[end + 1].kind == "FEED"

    @staticmethod
    def _check_on(there: np.ndarray, pose: np.ndarray, slack_mm: float, what: str) -> None:
        x, y, z, *angles = (pose - there).tolist()
        tilt_mm = LEVER_MM * math.radians(math.hypot(*angles))
        if max(abs(x), abs(y), abs(z)) > ROUNDINGS * slack_mm or tilt_mm > 2.0 * slack_mm + LEVER_MM * math.radians(
            2 * PRINTED
        ):
            raise DiffersError(f"{what}: {pose} in place of {there}")

    def _check_time(self, index: int, place: int, end: int) -> None:
        before, event = self.wanted[index - 1], self.wanted[index]
        way = _Arc(before, event) if event.kind == "ARC" else _Line(before, event)
        took = way.minutes(event)
        if took is None:
            return
        rounded = 2.0 * PRINTED * (event.unit_mm + before.unit_mm) / min(event.feed[0], 1e9)
        took_done = 0.0
        for piece in range(place, end):
            line = _Line(self.done[piece - 1], self.done[piece])
            minutes = line.minutes(self.done[piece])
            if minutes is None:
                return
            took_done += minutes
            # Places and the feed are printed with four decimals: a feed of 0.0002 mm/min has one digit.
            least_feed = self.done[piece].feed[0] - PRINTED
            if least_feed <= 0.0:
                return
            rounded += 4.0 * PRINTED / least_feed + (1e-6 + PRINTED / least_feed) * minutes
        if abs(took - took_done) > SHARE_OF_TIME * took + rounded:
            raise DiffersError(f"move {index} takes {60 * took_done} s in place of {60 * took} s")


class _Line:
    """A straight move, as LinuxCNC runs it."""

    def __init__(self, before: Event, event: Event) -> None:
        self.start, self.end = before.pose, event.pose
        self.way = self.end - self.start
        self.unit_mm = max(before.unit_mm, event.unit_mm)
        self.weighed = SCALE**2 * self.way
        self.length = float(self.weighed @ self.way)

    def nearest(self, pose: np.ndarray) -> np.ndarray:
        share = 0.0 if self.length == 0.0 else float((pose - self.start) @ self.weighed) / self.length
        return self.start + min(max(share, 0.0), 1.0) * self.way

    def is_at_end(self, pose: np.ndarray, slack: float) -> bool:
        off = [abs(away) for away in (pose - self.end).tolist()]
        return max(off[:3]) < slack and max(off[3:]) < 4.0 * PRINTED

    def minutes(self, event: Event) -> float | None:
        """Time at the feed; None where the printed decimals do not tell it."""
        tip, turn = float(np.linalg.norm(self.way[:3])), float(np.linalg.norm(self.way[3:]))
        if tip > 20.0 * PRINTED * self.unit_mm:
            return tip / event.feed[0] if event.feed[0] > 0.0 else None
        # The tip may move by less than is printed, and F counts along that.
        return turn / event.feed[1] if tip == 0.0 and turn > 0.0 and event.unit_mm > 1.0 else None


class _Arc:
    """An arc with everything beside its plane moving evenly along it; a spiral where its radii differ by a rounding."""

    def __init__(self, before: Event, event: Event) -> None:
        self.start, self.end = before.pose, event.pose
        self.centre, self.plane = np.array(event.centre_mm), list(PLANES[event.plane])
        first, last = self.start[self.plane] - self.centre, self.end[self.plane] - self.centre
        self.sign = math.copysign(1.0, event.turns)
        swept = (self.sign * (math.atan2(last[1], last[0]) - math.atan2(first[1], first[0]))) % math.tau
        # Ends that are one within what is printed: a full turn.
        unsure = 4.0 * PRINTED * (event.unit_mm + before.unit_mm) / math.hypot(*first)
        if swept < unsure or math.tau - swept < unsure:
            swept = math.tau
        self.swept = swept + (abs(event.turns) - 1) * math.tau
        self.radii = math.hypot(*first), math.hypot(*last)
        self.first = self.at = math.atan2(first[1], first[0])
        self.turned = 0.0

    def nearest(self, pose: np.ndarray) -> np.ndarray:
        x, y = pose[self.plane] - self.centre
        now = math.atan2(y, x)
        step = (self.sign * (now - self.at) + math.pi) % math.tau - math.pi
        self.at, self.turned = now, self.turned + step
        # The angle tells the place on a steep helix badly: one step of least squares along it.
        share, small = self.turned / self.swept, 1e-6
        there = self._place(share)
        along = SCALE * (self._place(share + small) - there) / small
        return self._place(share + float(SCALE * (pose - there) @ along) / float(along @ along))

    def _place(self, share: float) -> np.ndarray:
        there: np.ndarray = self.start + share * (self.end - self.start)
        angle = self.first + self.sign * share * self.swept
        radius = self.radii[0] + share * (self.radii[1] - self.radii[0])
        there[self.plane] = self.centre + radius * np.array([math.cos(angle), math.sin(angle)])
        return there

    def is_at_end(self, pose: np.ndarray, slack: float) -> bool:
        return self.swept - self.turned < slack / min(self.radii) and _Line.is_at_end(self, pose, slack)  # type: ignore[arg-type]

    def minutes(self, event: Event) -> float | None:
        flat = self.swept * sum(self.radii) / 2.0
        return math.hypot(flat, float((self.end - self.start)[3 - sum(self.plane)])) / event.feed[0]


def _same(what: str, one: object, other: object) -> None:
    if one != other:
        raise DiffersError(f"{what}: {one} and {other}")
