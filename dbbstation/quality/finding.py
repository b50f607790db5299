"""One finding: a number, its limit by chance, and their meaning."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from dbbstation.facts.serialise import Kept


class Name(StrEnum):
    """Kinds of findings in listing order."""

    CIRCLE = "circle"
    """The recording shows no full circle: nothing else can be judged."""
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
        limit: of a sound run, or None.
        text: finding, place and remedy; or why undecided.
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
        """Return whether the run must not be used as it is."""
        return self.verdict is FindingVerdict.WRONG


def found(name: Name, value: float, limit: float, unit: str, sound: str, wrong: str, short: str = "") -> Finding:
    """Return a finding by value and limit."""
    verdict = FindingVerdict.WRONG if value > limit else FindingVerdict.GOOD
    return Finding(name, value, limit, unit, verdict, wrong if verdict is FindingVerdict.WRONG else sound, short)


def undecided(name: Name, why: str, unit: str = "", value: float | None = None) -> Finding:
    """Return an undecided finding with its reason."""
    return Finding(name, value, None, unit, FindingVerdict.CANNOT_TELL, why)


def against_limit(finding: Finding) -> str:
    """Return number and limit with unit, if any."""
    if finding.value is None:
        return ""
    limit = "" if finding.limit is None else f" of {finding.limit:.2f}"
    return f"{finding.value:.2f}{limit} {finding.unit}".rstrip()


def stricter(one: Finding, other: Finding) -> Finding:
    """Return the finding with the stricter knowledge.

    Wrong precedes good, which precedes undecided. Equal decisions rank by use of their limit. For better fitting
    circles, the knowledge with more circles decides.
    """
    if one.wrong or other.wrong:
        return max((each for each in (one, other) if each.wrong), key=_share)
    if one.verdict is other.verdict:
        return max(one, other, key=_share)
    doubted = one.name is Name.TEST and one.value is not None
    return other if one.verdict is FindingVerdict.CANNOT_TELL and not doubted else one


def _share(finding: Finding) -> float:
    return finding.value / finding.limit if finding.value is not None and finding.limit else 0.0
