"""What goes wrong with balls, programs and gauges: the table of docs/validation.md."""

from __future__ import annotations

import collections
import sys
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from pathlib import Path

import numpy as np

from dbbstation.plan.plan import Circle
from dbbstation.quality.finding import Name
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Seen, seen
from dbbstation.trace.recording import Recording
from tests.plant.run import Slot
from tests.quality.sessions import TESTS, Sound, calibrated, finding_of, read, sound
from tests.quality.spoilers import begun_elsewhere, coming_twice, elsewhere, mirrored, overridden, progress, scaled


class Fault(StrEnum):
    """What goes wrong with the equipment, as whole: not how large the number of a finding comes out."""

    OTHER_TEST = "program and ball of another test"
    TILT = "wrong tilt"
    START = "wrong start"
    DIRECTION = "wrong direction"
    KNOCKED = "knocked ball"
    STUCK = "stuck length"
    CLIPPED = "clipped length"
    SCALED = "gauge counts too much"
    TWICE = "readings that come twice"
    OVERRIDE = "feed too slow, then too quick"
    TILT_BOTH = "wrong tilt, both directions"
    EXCHANGED = "exchanged balls, both directions"


SIZES: dict[Fault, tuple[float, ...]] = {
    Fault.TILT: (1.0, 5.0, 15.0),
    Fault.START: (5.0, 30.0, 180.0),
    Fault.KNOCKED: (1.0, 2.0, 5.0),
    Fault.STUCK: (1.0, 2.0, 5.0),
    Fault.CLIPPED: (1.0, 2.0, 5.0),
    Fault.SCALED: (1.0, 2.0, 5.0),
    Fault.OVERRIDE: (5.0, 20.0),
    Fault.TILT_BOTH: (5.0, 10.0, 15.0),
    Fault.EXCHANGED: (36.0, 100.0),
}
"""Tilt and start are off by so many degrees, a knocked ball by as many limits, a length stands still for as many limits, a gauge counts so many
percent too much, a feed is off by as many; exchanged balls are off by so many micrometres, either way."""

SPOILT_BY: dict[Fault, Callable[[Recording, Circle, float], Recording]] = {
    Fault.START: begun_elsewhere,
    Fault.DIRECTION: mirrored,
    Fault.SCALED: scaled,
    Fault.TWICE: lambda recording, circle, _size: coming_twice(recording, circle),
    Fault.OVERRIDE: overridden,
    Fault.EXCHANGED: elsewhere,
}
"""What spoils the recording of a run by a size; one where a fault has none."""

ALIKE: dict[Fault, Callable[[str, str], bool]] = {
    Fault.SCALED: lambda _one, _other: True,
    Fault.TWICE: lambda _one, _other: True,
    Fault.TILT_BOTH: lambda one, other: one == other,
    Fault.EXCHANGED: lambda one, other: other in {one, _partner(one)},
}
"""Faults that were there before, in other runs too: whether in those of another test."""


def _partner(test: str) -> str:
    return TESTS[TESTS.index(test) ^ 1]


class When(StrEnum):
    """What the session knows already."""

    FIRST = "first pair"
    LATER = "later"
    REPEATED = "after a repeat"


def before(whole: Sound, spoilt: Seen, when: When) -> list[Seen]:
    own = [one for one in whole.runs if one.run.test == spoilt.run.test and one.run.repeat == 1]
    own = [one for one in own if one.run.circle.direction is not spoilt.run.circle.direction]
    rest = [one for one in whole.runs if one.run.test != spoilt.run.test]
    return [*rest, *own] if when is When.LATER else own


def faulty(whole: Sound, tilted: dict[float, Sound], run: int, fault: Fault, size: float, known: list[Seen]) -> Seen:
    one = whole.runs[run].run
    if fault is Fault.OTHER_TEST:
        return seen(replace(one, recording=whole.runs[int(size)].run.recording))
    if fault in {Fault.TILT, Fault.TILT_BOTH}:
        return seen(replace(one, recording=tilted[size].runs[run].run.recording))
    if fault in SPOILT_BY:
        if fault is Fault.EXCHANGED and TESTS.index(one.test) % 2:
            size = -size
        return seen(replace(one, recording=SPOILT_BY[fault](one.recording, one.circle, size)))
    name = Name.OTHER_DIRECTION if fault is Fault.KNOCKED else Name.HELD
    found = finding_of(SessionRuns([*known, whole.runs[run]]).judge(whole.runs[run]), name)
    limit = 0.0 if found is None or found.limit is None else found.limit
    if fault is Fault.KNOCKED:
        # A shift d shows as d / sqrt 2 in the rms of the form, on top of what is there.
        return seen(replace(one, recording=elsewhere(one.recording, one.circle, np.sqrt(2.0) * size * limit)))
    return seen(
        replace(one, recording=standing(one.recording, one.circle, size * limit, clipped=fault is Fault.CLIPPED))
    )


def standing(recording: Recording, circle: Circle, held_s: float, *, clipped: bool) -> Recording:
    """A length that stands still for a while in the middle of the turn, or that goes no farther than what it has there."""
    phi = progress(recording, circle)
    first = int(np.searchsorted(phi, 140.0))
    last = int(np.searchsorted(recording.t_s, recording.t_s[first] + held_s))
    length_mm = recording.length_mm.copy()
    inside = slice(first, last + 1)
    length_mm[inside] = np.quantile(length_mm[inside], 0.02) if clipped else length_mm[first]
    return replace(recording, length_mm=length_mm)


def tilted_by(folder: Path, seed: int, degrees: float) -> Sound:
    """The same machine and the same day, all circles tilted by so much more about X."""

    def more(_slot: Slot, poses: np.ndarray) -> np.ndarray:
        return poses + np.array([0.0, 0.0, 0.0, degrees, 0.0, 0.0])

    return sound(folder, seed, TESTS, reprogram=more)


Row = collections.Counter[tuple[Fault, float, When, bool, str]]


def equipment(folder: Path, seed: int) -> Row:
    """Judge each run of a session with each fault, as it would be judged at the machine; count what comes of it."""
    counted: Row = collections.Counter()
    modelled = calibrated(folder, seed)
    for with_model in (False, True):
        whole = modelled if with_model else read(folder / "spoilt")
        tilted = {
            degrees: tilted_by(folder / f"t{degrees}{with_model}", seed, degrees)
            for degrees in sorted({*SIZES[Fault.TILT], *SIZES[Fault.TILT_BOTH]})
        }
        runs = [k for k, one in enumerate(whole.runs) if one.run.repeat == 1]
        # The second direction of each test: the first has been accepted.
        seconds = [k for n, k in enumerate(runs) if n % 2 == 1]
        for run in seconds:
            for when in When:
                _count(counted, whole, tilted, run, when, with_model=with_model)
    return counted


def _count(counted: Row, whole: Sound, tilted: dict[float, Sound], run: int, when: When, *, with_model: bool) -> None:
    one = whole.runs[run]
    known = before(whole, one, when)
    alike = [
        k
        for k, o in enumerate(whole.runs)
        if o.run.test != one.run.test and o.run.repeat == 1 and o.run.circle.direction is one.run.circle.direction
    ]
    for fault in Fault:
        for size in alike if fault is Fault.OTHER_TEST else SIZES.get(fault, (1.0,)):
            spoilt = faulty(whole, tilted, run, fault, size, known)
            if when is When.REPEATED:
                # The run before was wrong in the same way, and rejected; this is its repeat.
                spoilt = replace(spoilt, run=replace(spoilt.run, repeat=2))
            before_it = known
            if fault in ALIKE:
                before_it = [_alike(whole, tilted, k, one, fault, size) for k in known]
            judged = SessionRuns([*before_it, spoilt]).judge(spoilt)
            shown = 0.0 if fault is Fault.OTHER_TEST else size
            counted[fault, shown, when, with_model, "of"] += 1
            counted[fault, shown, when, with_model, "found"] += bool(judged.wrong)


def _alike(whole: Sound, tilted: dict[float, Sound], known: Seen, one: Seen, fault: Fault, size: float) -> Seen:
    if not ALIKE[fault](one.run.test, known.run.test):
        return known
    return faulty(whole, tilted, whole.runs.index(known), fault, size, [])


def print_equipment(counted: Row) -> None:
    heads = [(when, with_model) for with_model in (False, True) for when in When]
    titles = [f"{when}{', model' if with_model else ''}" for when, with_model in heads]
    sys.stdout.write(f"| fault | size | {' | '.join(titles)} |\n|{' --- |' * (len(heads) + 2)}\n")
    for fault in Fault:
        for size in sorted({key[1] for key in counted if key[0] is fault}):
            cells = [f"{counted[fault, size, *head, 'found']} of {counted[fault, size, *head, 'of']}" for head in heads]
            shown = f"{size:g}" if fault in SIZES else ""
            sys.stdout.write(f"| {fault} | {shown} | {' | '.join(cells)} |\n")
