"""Runs spoilt so that a finding comes to shares of its limit: the table of docs/validation.md."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.judge import Judgement, SessionRuns
from dbbstation.quality.knowledge import Seen, seen
from dbbstation.trace.expected import HIGHEST_HARMONIC
from dbbstation.trace.recording import Recording
from tests.quality.sessions import Sound, finding_of
from tests.quality.spoilers import SPOILERS, longer, mirrored, progress, quiet_deg

SHARES = (0.5, 1.0, 2.0)
"""Sizes of what is spoilt, as shares of the limit."""


@dataclass(frozen=True)
class Spoilt:
    """One run, spoilt by a share of a limit."""

    name: Name
    share: float
    value: float | None
    limit: float
    verdict: FindingVerdict
    also: tuple[str, ...]


def spoil(whole: Sound, run: int, name: Name, shares: Sequence[float] = SHARES) -> Iterator[Spoilt]:
    """Spoil a run so that its value comes to each share of its limit, as far as it can be brought there."""
    before = finding_of(SessionRuns(whole.runs).judge(whole.runs[run]), name)
    assert before is not None
    assert before.limit is not None, before.text
    limit = _limit_of_fault(whole, run, name, before.limit)
    for share in shares:
        judged = _spoilt(whole, run, name, _size(whole, run, name, share * limit))
        after = finding_of(judged, name)
        others = tuple(f"{f.name}" for f in judged.wrong if f.name is not name)
        verdict = FindingVerdict.CANNOT_TELL if after is None else after.verdict
        yield Spoilt(name, share, None if after is None else after.value, limit, verdict, others)


def _limit_of_fault(whole: Sound, run: int, name: Name, limit: float) -> float:
    if name not in {Name.OTHER_DIRECTION, Name.REPEAT}:
        return limit
    found = finding_of(_spoilt(whole, run, name, 5.0 * limit), name)
    assert found is not None
    assert found.limit is not None
    return found.limit


def _spoilt(whole: Sound, run: int, name: Name, size: float) -> Judgement:
    one = whole.runs[run].run
    if name is Name.DIRECTION:
        return _wrong_way(whole, run, size)
    if name in {Name.BUMP, Name.SPIKE}:
        return whole.with_spoilt(run, SPOILERS[name](one.recording, one.circle, size, quiet_deg(one)))
    return whole.with_spoilt(run, SPOILERS[name](one.recording, one.circle, size))


def _wrong_way(whole: Sound, run: int, apart_um: float) -> Judgement:
    """Run the wrong way round on a mounting where the circle lies half of `apart_um` off the axis through its start."""
    one = whole.runs[run]
    other = next(
        k
        for k, o in enumerate(whole.runs)
        if o.run.mounting == one.run.mounting and o.run.circle.direction is not one.run.circle.direction
    )
    moved = {k: _put_across(whole.runs[k], 0.5 * apart_um) for k in (run, other)}
    runs = [seen(replace(o.run, recording=moved[k])) if k in moved else o for k, o in enumerate(whole.runs)]
    return Sound(runs).with_spoilt(run, mirrored(runs[run].run.recording, runs[run].run.circle, 1.0))


def _put_across(one: Seen, um: float) -> Recording:
    """Bring the first sine of a circle to a size and take its third away, so that a shift remains."""
    circle, recording = one.run.circle, one.run.recording
    theta = np.radians(circle.theta_deg(progress(recording, circle)) - circle.start_deg)
    first, _, third = one.coefficients_um[HIGHEST_HARMONIC + 1 :]
    return longer(recording, np.sqrt(2.0) * ((um - first) * np.sin(theta) - third * np.sin(3.0 * theta)))


def _size(whole: Sound, run: int, name: Name, wanted: float) -> float:
    if name in {Name.LOST, Name.FEED, Name.DIRECTION}:
        return wanted
    size = wanted
    for _ in range(ROUNDS):
        found = finding_of(_spoilt(whole, run, name, size), name)
        assert found is not None
        assert found.value is not None, found.text
        if abs(found.value / wanted - 1.0) < 0.01:
            break
        size *= wanted / found.value
    return size


ROUNDS = 8
"""Corrections of a fault's size: some faults join what noise shows already, and their value is not quite proportional."""
