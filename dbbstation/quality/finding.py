"""One finding: a number, the limit that chance keeps it under, and what both say."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated

from dbbstation.facts.serialise import Kept


class Name(StrEnum):
    """What is looked for, in the order in which they are listed."""

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


class FindingVerdict(StrEnum):
    """What a finding says."""

    GOOD = "good"
    WRONG = "wrong"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True)
class Finding:
    """One thing that was looked for in one run.

    Attributes:
        value: the number found; None where there is none.
        limit: greatest value of a sound run; None where none can be given.
        verdict: whether the value keeps the limit.
        text: what was found, where, and what to do where it is wrong; why it cannot be decided where it cannot.
        short: the same in the fewest words; empty where name, value and limit are that.
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
        """Whether the run should not be used as it is."""
        return self.verdict is FindingVerdict.WRONG


def found(name: Name, value: float, limit: float, unit: str, sound: str, wrong: str, short: str = "") -> Finding:
    """Return a finding of a value that a limit is held against.

    Args:
        limit: greatest that is sound.
        sound: text where the limit is kept.
        short: what was found, in the fewest words.
    """
    verdict = FindingVerdict.WRONG if value > limit else FindingVerdict.GOOD
    return Finding(name, value, limit, unit, verdict, wrong if verdict is FindingVerdict.WRONG else sound, short)


def undecided(name: Name, why: str, unit: str = "", value: float | None = None) -> Finding:
    """Return a finding that cannot be decided, and why."""
    return Finding(name, value, None, unit, FindingVerdict.CANNOT_TELL, why)


def against_limit(finding: Finding) -> str:
    """Return a finding's number and limit with their unit, as far as there are any."""
    if finding.value is None:
        return ""
    limit = "" if finding.limit is None else f" of {finding.limit:.2f}"
    return f"{finding.value:.2f}{limit} {finding.unit}".rstrip()


def stricter(one: Finding, other: Finding) -> Finding:
    """Return of two findings of the same thing, held against what two bodies of knowledge say, the one that leaves less open.

    A sound run agrees with both. Wrong goes before good, and good before what cannot be told. Of two that are decided alike the
    one counts that has more of its limit. Whether another circle explains the readings better is asked of all circles that a
    body of knowledge holds: who knows fewer of them does not settle what the other one cannot tell.

    Args:
        one: by the body of knowledge that holds more circles.
        other: by the one that holds fewer.
    """
    if one.wrong or other.wrong:
        return max((each for each in (one, other) if each.wrong), key=_share)
    if one.verdict is other.verdict:
        return max(one, other, key=_share)
    doubted = one.name is Name.TEST and one.value is not None
    return other if one.verdict is FindingVerdict.CANNOT_TELL and not doubted else one


def _share(finding: Finding) -> float:
    return finding.value / finding.limit if finding.value is not None and finding.limit else 0.0
