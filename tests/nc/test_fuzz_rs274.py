"""Programs from a grammar, read by us and by LinuxCNC's own interpreter: the same machine motion, or refused by both.

Two hundred and eight hold every word of the grammar that a thousand hold; `-m nightly` runs twenty times as many. `DBBSTATION_FUZZ=5000` runs as many
programs as that; `DBBSTATION_FUZZ_FROM` is the first seed.
"""

from __future__ import annotations

import math
import os
import re
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
import pytest

from dbbstation.errors import InputError
from dbbstation.nc.rs274.reader import NO_END, read_program
from dbbstation.nc.toolpath import RowKind, Toolpath
from tests.nc.grammar import program
from tests.nc.interpreter import MOTION, PLANES, Event, events, needs_rs274

pytestmark = [
    needs_rs274,
    pytest.mark.slow,
]

COUNT = int(os.environ.get("DBBSTATION_FUZZ", "200"))
FIRST = int(os.environ.get("DBBSTATION_FUZZ_FROM", "0"))

RARE = (221, 292, 319, 480, 697, 728, 777, 953)
"""Seeds of programs with words that none of the first two hundred has."""

ONLY_BY_US = {
    "where the machine stands": "the program does not state the place of",
    "percent sign not closed": "the % that closes it",
    "F in the line that changes units": "counts in the units before it",
    "code that is not read": r"[GM][\d.]+ is not read",
    "word that is not read": "words with the letter|is not read",
    "P wanted twice": "both take P",
    "polar coordinates": "polar coordinates|from the origin need an angle",
    "skipped line": "a switch of the control skips",
    "value of the control": "is read before the program sets it|the diameter of tool",
    "word that does nothing": "nothing in this line uses",
    "number with a second sign": "has no number",
}
"""What LinuxCNC runs and we refuse on purpose: what it depends on is not in the program, or two controls differ."""

NOWHERE = 3e-3
"""Rapids over less are left out of both: four decimals of an inch are printed [mm, deg]."""

MOST_ONLY_BY_US = 0.08
"""Share of programs; the grammar asks for such things more often than people do."""


@pytest.fixture(scope="module", params=[COUNT, pytest.param(20 * COUNT, marks=pytest.mark.nightly)])
def verdicts(request, tmp_path_factory):
    """(seed, text, what we say, what LinuxCNC says) of every program: toolpath or error, events or None."""
    folder, drawn = tmp_path_factory.mktemp("rs274"), programs(request.param)

    def both(which: tuple[int, str]) -> tuple[int, str, Toolpath | InputError, list[Event] | None]:
        own, we = folder / str(which[0]), ours(which[1])
        own.mkdir()
        # LinuxCNC wants an end, or percent signs.
        notes = we.notes if isinstance(we, Toolpath) else ()
        text = f"%\n{which[1]}\n%\n" if NO_END in notes else which[1]
        # LinuxCNC has no motion behind G80.
        text = re.sub(r"(?i)(G80\b.*)", r"\1\nG0", text) if any("behind G80" in note for note in notes) else text
        return *which, we, events(text, own)

    with ThreadPoolExecutor(2) as threads:
        return list(threads.map(both, drawn))


def programs(count: int) -> list[tuple[int, str]]:
    return [(seed, program(seed)) for seed in sorted({*range(FIRST, FIRST + count), *RARE})]


def ours(text: str) -> Toolpath | InputError:
    try:
        return read_program(text, "drawn.ngc")
    except InputError as error:
        return error


def test_what_linuxcnc_refuses_is_refused(verdicts):
    accepted = [text for _, text, we, they in verdicts if they is None and isinstance(we, Toolpath)]
    assert not accepted, f"{len(accepted)} programs, the first:\n{accepted[0]}"


def test_what_both_read_is_the_same_motion(verdicts):
    both = [
        (seed, text, we, they) for seed, text, we, they in verdicts if isinstance(we, Toolpath) and they is not None
    ]
    assert len(both) > 0.15 * len(verdicts)
    for seed, text, we, they in both:
        differs = difference(we, they)
        assert not differs, f"seed {seed}: {differs}\n{text}"


def test_what_only_we_refuse_is_little_and_has_a_name(verdicts):
    reasons: dict[str, int] = {}
    for seed, text, we, they in verdicts:
        if they is not None and isinstance(we, InputError):
            named = [name for name, said in ONLY_BY_US.items() if re.search(said, str(we))]
            assert named, f"seed {seed}: {we}\n{text}"
            reasons[named[0]] = reasons.get(named[0], 0) + 1
    refused = sum(they is None for *_, they in verdicts)
    equal = sum(isinstance(we, Toolpath) for _, _, we, _ in verdicts)
    print(f"{len(verdicts)} programs, {equal} equal, {refused} refused by both, by us only: {reasons}")  # noqa: T201 - with -s
    assert sum(reasons.values()) <= MOST_ONLY_BY_US * len(verdicts), reasons


def difference(path: Toolpath, they: list[Event]) -> str:
    they = moving([event for event in they if event.kind in MOTION])
    groups = divided(path, grouped(path), they)
    if [kind for kind, _ in groups] != ["FEED" if event.kind == "ARC" else event.kind for event in they]:
        return f"{[kind for kind, _ in groups]} and {[event.kind for event in they]}"
    before: np.ndarray | None = None
    feed, only_turns = path.feed, path.only_turns
    for (_, rows), event in zip(groups, they, strict=True):
        # In inches the printed offsets are rounded as much as the pose.
        rounding = np.array([(0.51e-4 if event.unit_mm == 1.0 else 1.6e-4) * event.unit_mm] * 3 + [0.51e-4] * 3)
        poses, line = path.poses[rows], path.line[rows[0]]
        if event.kind in {"RAPID", "FEED", "ARC"}:
            if (np.abs(poses[-1] - event.pose) > rounding).any():
                return f"line {line}: {poses[-1]} and {event.pose}"
            if event.kind == "ARC" and before is not None:
                off_mm = off_arc_mm(before, poses, event)
                if off_mm > 2e-3 * event.unit_mm:
                    return f"line {line}: {off_mm} mm off the arc"
            before = poses[-1]
        if event.kind in {"FEED", "ARC"}:
            mine, unit_mm = feed[rows[0]], 1.0 if only_turns[rows[0]] else event.unit_mm
            if not np.isclose(mine, event.feed[int(only_turns[rows[0]])], rtol=1e-9, atol=0.51e-4 * unit_mm):
                return f"line {line}: feeds {mine} and {event.feed}"
        if event.kind == "DWELL" and abs(path.dwell_s[rows[0]] - event.dwell_s) > 0.51e-4:
            return f"line {line}: dwells {path.dwell_s[rows[0]]} and {event.dwell_s}"
    return ""


def moving(they: list[Event], before: np.ndarray | None = None) -> list[Event]:
    """Without rapids that lead nowhere, as cycles have some."""
    kept: list[Event] = []
    before = np.full(6, np.nan) if before is None else before
    for event in they:
        if event.kind != "RAPID" or not np.allclose(event.pose, before, rtol=0.0, atol=NOWHERE):
            kept.append(event)
        before = event.pose
    return kept


def grouped(path: Toolpath) -> list[tuple[str, np.ndarray]]:
    """Rows of moves, dwells and pauses, the chords of an arc together, without rapids that lead nowhere."""
    told = [row for row, kind in enumerate(path.kind) if RowKind(kind).name in MOTION]
    still = (path.kind == RowKind.RAPID) & (np.abs(path.poses - path.before).max(axis=1) < NOWHERE)
    told = [row for place, row in enumerate(told) if place == 0 or not still[row]]
    groups: list[list[int]] = []
    arc, cuts = path.arc, path.kind == RowKind.FEED
    for row in told:
        last = groups[-1][-1] if groups else row
        same = (
            groups
            and cuts[row]
            and cuts[last]
            and path.line[row] == path.line[last]
            and arc[row, 2] != 0.0
            and np.array_equal(arc[row], arc[last])
        )
        if same:
            groups[-1].append(row)
        else:
            groups.append([row])
    return [(RowKind(path.kind[rows[0]]).name, np.array(rows)) for rows in groups]


def divided(path: Toolpath, groups: list[tuple[str, np.ndarray]], they: list[Event]) -> list[tuple[str, np.ndarray]]:
    """Groups of chords with no more turns than LinuxCNC's arcs: a loop may run one line's arc again."""
    found, left, turn = [], list(groups), path.arc[:, 2]
    if left and they and left[0][0] == "RAPID" != they[0].kind and path.start is not None:
        left.pop(0)  # where a program stands that begins with a cut
    while left:
        kind, rows = left.pop(0)
        turned = abs(turn[rows[0]])
        if len(found) < len(they) and they[len(found)].kind == "ARC" and turned:
            most = round(math.tau * abs(they[len(found)].turns) / turned)
            left[:0] = [(kind, rows[most:])] if len(rows) > most else []
            rows = rows[:most]
        found.append((kind, rows))
    return found


def off_arc_mm(start: np.ndarray, poses: np.ndarray, event: Event) -> float:
    """Greatest distance between our chords and the arc that LinuxCNC runs, and of Z and angles from their even way."""
    centre, plane = np.array(event.centre_mm), list(PLANES[event.plane])
    first, last = start[plane] - centre, event.pose[plane] - centre
    sign = math.copysign(1.0, event.turns)
    swept = (sign * (math.atan2(last[1], last[0]) - math.atan2(first[1], first[0]))) % math.tau
    unsure = 4.0 * 0.51e-4 * event.unit_mm / min(np.hypot(*first), np.hypot(*last))  # four decimals are printed
    if swept < unsure or math.tau - swept < unsure:  # a full turn or next to none: as many chords as ours
        step_mm = np.linalg.norm(poses[0, plane] - start[plane])
        swept = math.tau if step_mm * len(poses) > math.pi * np.hypot(*first) else swept % math.pi
    swept += (abs(event.turns) - 1) * math.tau
    nodes = np.vstack([start, poses])
    share = np.linspace(0.0, 1.0, len(nodes))
    angle = math.atan2(first[1], first[0]) + sign * share * swept
    radius = np.hypot(*first) + share * (np.hypot(*last) - np.hypot(*first))
    there = start + share[:, None] * (event.pose - start)
    there[:, plane] = centre + np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    # Half-way between two points the chord is farthest inside its arc.
    sagitta = max(radius[k] * (1.0 - math.cos((b - a) / 2.0)) for k, (a, b) in enumerate(pairwise(angle)))
    return float(np.abs(nodes - there).max()) + sagitta
