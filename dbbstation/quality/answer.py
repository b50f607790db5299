"""Decide GOOD, REPEAT or CANNOT TELL for a run, with cause and remedy."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.quality.finding import DO, Finding, FindingVerdict, Name, times_limit
from dbbstation.quality.limits import LOG_ODDS_LIMIT

if TYPE_CHECKING:
    from collections.abc import Sequence


class Advice(StrEnum):
    """The decision, as shown to users."""

    GOOD = "GOOD"
    REPEAT = "REPEAT"
    CANNOT_TELL = "CANNOT TELL"


@dataclass(frozen=True)
class RunAssessment:
    """What to do with a run.

    Attributes:
        causes: for REPEAT: one sentence with finding and remedy per cause, the most explanatory first.
        unseen: for CANNOT TELL: possible faults that no measurement of the plan shows.
        settled_by: for CANNOT TELL: measurements that would show these faults.
    """

    word: Advice
    causes: tuple[str, ...] = ()
    unseen: tuple[str, ...] = ()
    settled_by: tuple[str, ...] = ()
    later: tuple[str, ...] = ()


def answer(findings: Sequence[Finding], problem: str = "", to_come: int = 0) -> RunAssessment:
    """Return the decision on a run.

    Any fault gives REPEAT. Missing findings, or a fault of `SHOWN_BY` that neither this run nor later circles can show,
    give CANNOT TELL. Otherwise the run is GOOD.

    Args:
        to_come: circles of the plan not yet measured.
    """
    wrong = [one for one in findings if one.wrong]
    if problem and not any(one.name is Name.CIRCLE for one in wrong):
        wrong.append(Finding(Name.CIRCLE, None, None, "", FindingVerdict.WRONG, problem))
    if wrong:
        return RunAssessment(Advice.REPEAT, tuple(cause_of(one) for one in sorted(wrong, key=rank)))
    decided = {one.name for one in findings if one.verdict is not FindingVerdict.CANNOT_TELL}
    hidden = [fault for fault, names in SHOWN_BY.items() if not decided & names]
    # An undecided fault is doubted if it is likelier than not, given a prior probability of 0.001.
    open_ones = [one for one in findings if one.verdict is FindingVerdict.CANNOT_TELL]
    hidden += [DOUBTED[one.name] for one in open_ones if one.name in DOUBTED and (one.value or 0.0) > LOG_ODDS_LIMIT]
    later = tuple(fault for fault in hidden if findings and to_come and fault in SHOWN_LATER)
    unseen = tuple(fault for fault in hidden if fault not in later)
    settled_by = tuple(
        dict.fromkeys(SHOWN_LATER.get(fault, BY_PLAN) for fault in unseen if fault not in DOUBTED.values())
    )
    return RunAssessment(Advice.CANNOT_TELL if unseen else Advice.GOOD, (), unseen, settled_by, later)


def cause_of(finding: Finding) -> str:
    """Return a wrong finding's short text and its remedy."""
    if finding.name is Name.CIRCLE:  # its text contains the remedy
        return finding.text
    numbers = "" if finding.value is None else f" {finding.value:.2f}"
    numbers += "" if finding.limit is None else f" of {finding.limit:.2f}"
    found = finding.short or f"{finding.name}{numbers} {finding.unit}".rstrip()
    return f"{found}: {DO[finding.name]}"


EXPLAINS = (
    (Name.HELD, Name.LOST),
    (Name.COPIED,),
    (Name.REPEATED,),
    (Name.FEED,),
    (Name.CIRCLE,),
    (Name.SCALE,),
    (Name.BUMP, Name.CLOSURE, Name.DRIFT, Name.NOISE, Name.RADIUS),
    (Name.SPIKE,),
    (Name.PROGRAMS,),
    (Name.TEST, Name.DIRECTION),
    (Name.LOCAL,),
    (Name.BAR,),
    (Name.OTHER_DIRECTION, Name.REPEAT),
    (Name.BORE,),
    (Name.FORM,),
    (Name.SINCE,),
)
"""Findings in causal order. A wrong feed also moves the end of the turn and differs from the other direction, but
neither of these changes the feed. A drift moves centre and mean. A ball that moved between both directions is also in
the wrong place; a ball misplaced from the beginning does not differ between directions. Findings of one group are
ranked by value over limit, because all limits have the same probability."""


def rank(finding: Finding) -> tuple[int, float]:
    """Return a sort key: the most explanatory finding first."""
    place = next(k for k, names in enumerate(EXPLAINS) if finding.name in names)
    times = times_limit(finding)
    if Name.BUMP in EXPLAINS[place] and times < CLEARLY:
        place = next(k for k, names in enumerate(EXPLAINS) if Name.LOCAL in names)
    return place, -times


CLEARLY = 2.0
"""A disturbance above this multiple of its limit explains a wrong form; below, the wrong form explains the disturbance."""


_TEST, _DIRECTION = "whether it is the circle of another test", "whether it ran the wrong way round"
_BALL, _PROGRAMS = "whether the ball stands where it stood", "whether all programs ran as the plan has them"

SHOWN_BY = {
    "whether something moved during the circle": frozenset({Name.CLOSURE, Name.DRIFT}),
    _TEST: frozenset({Name.TEST}),
    _DIRECTION: frozenset({Name.DIRECTION}),
    _BALL: frozenset({Name.OTHER_DIRECTION, Name.REPEAT, Name.SINCE}),
}
"""Faults that leave a circle smooth, each with the findings that show it. Other faults are visible in every run. The
finding `bore` is not listed: in the first test of a machine without model its limit is the machine's own errors,
millimetres."""

DOUBTED = {
    Name.PROGRAMS: _PROGRAMS,
    Name.BAR: "whether the bar is as long as stated (put it on its calibrator) or the machine makes all circles so",
}
"""Faults of all runs that other faults also explain: they count only if the readings favour them."""

BY_PLAN = "an overlap in the plan"

SHOWN_LATER = {
    _TEST: "two other tests, a model or a session before",
    _DIRECTION: "the other direction and another test",
    _BALL: "the other direction or a repeat",
    _PROGRAMS: "further tests in both directions, or a model",
}
"""Faults of this circle that later circles of the plan can show, with the measurements that show them if the plan has no circle left."""
