"""The result of one check: a number, the limit for chance, and a text."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from dbbstation.facts.serialise import Kept


class Name(StrEnum):
    """Names of checks, in the order of lists."""

    CIRCLE = "circle"
    """The recording contains no full circle, so other checks are impossible."""
    LOST = "lost samples"
    NOISE = "noise"
    CLOSURE = "closure"
    DRIFT = "drift"
    BUMP = "bump"
    SPIKE = "spike"
    HELD = "held length"
    REPEATED = "repeated readings"
    COPIED = "readings of another run"
    SCALE = "gauge scale"
    DIRECTION = "direction"
    TEST = "test"
    RADIUS = "radius"
    FEED = "feed"
    BORE = "bore"
    FORM = "form"
    OTHER_DIRECTION = "other direction"
    REPEAT = "repeat"
    LOCAL = "local difference"
    PROGRAMS = "all programs"
    BAR = "bar of all runs"
    SINCE = "session before"


class FindingVerdict(StrEnum):
    """Verdict of a finding."""

    GOOD = "good"
    WRONG = "wrong"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class Finding:
    """Result of one check of a run.

    Attributes:
        limit: limit for sound runs, or None.
        text: description with place and remedy, or the reason for no decision.
    """

    name: Name
    value: float | None
    limit: float | None
    unit: str
    verdict: FindingVerdict
    text: str
    short: Annotated[str, Kept] = ""

    @property
    def wrong(self) -> bool:
        """Return whether the finding is a fault, so the run must not be used unchanged."""
        return self.verdict is FindingVerdict.WRONG


UNITS = {
    **dict.fromkeys((Name.LOST, Name.REPEATED, Name.COPIED, Name.SCALE), "%"),
    **dict.fromkeys((Name.CIRCLE, Name.TEST, Name.PROGRAMS, Name.BAR), ""),
    Name.HELD: "s",
    Name.FEED: "mm/min",
}
"""Units that are not µm."""


def found(name: Name, value: float, limit: float, sound: str, wrong: str, short: str = "") -> Finding:
    """Return the finding that follows from value and limit."""
    verdict = FindingVerdict.WRONG if value > limit else FindingVerdict.GOOD
    text = wrong if verdict is FindingVerdict.WRONG else sound
    return Finding(name, value, limit, UNITS.get(name, "µm"), verdict, text, short)


def undecided(name: Name, why: str, value: float | None = None) -> Finding:
    """Return an undecided finding with its reason."""
    return Finding(name, value, None, UNITS.get(name, "µm"), FindingVerdict.CANNOT_TELL, why)


def against_limit(finding: Finding) -> str:
    """Return number and limit with unit, as text."""
    if finding.value is None:
        return ""
    limit = "" if finding.limit is None else f" of {finding.limit:.2f}"
    return f"{finding.value:.2f}{limit} {finding.unit}".rstrip()


def stricter(one: Finding, other: Finding) -> Finding:
    """Return the decisive one of two findings from different knowledge.

    Wrong precedes good, and good precedes undecided. Equal decisions are ranked by value over limit. If another circle
    fits better, the finding from more circles decides.
    """
    if one.wrong or other.wrong:
        return max((each for each in (one, other) if each.wrong), key=times_limit)
    if one.verdict is other.verdict:
        return max(one, other, key=times_limit)
    doubted = one.name is Name.TEST and one.value is not None
    return other if one.verdict is FindingVerdict.CANNOT_TELL and not doubted else one


def times_limit(finding: Finding) -> float:
    """Return the value as a multiple of its limit."""
    return finding.value / finding.limit if finding.value is not None and finding.limit else 0.0
