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


DO = {
    Name.HELD: "the plunger sticks or the stroke ends; free it, check the plug, run the circle again",
    Name.LOST: "check plug and cable, close other programs on the computer, run the circle again",
    Name.FEED: "set the override on the control to 100 %, run the circle again; if this feed is intended, state it in the plan",
    Name.TEST: "check bore, holder, tilt and which program was started, run the circle again",
    Name.DIRECTION: "this circle or the one before ran the wrong way round: check which program was started (G2 or G3)",
    Name.RADIUS: "check which bar is in, radius and plane (G17) in the program and the tool length, run the circle again",
    Name.SPIKE: "check plug, cable and earth of the gauge, run the circle again",
    Name.BUMP: "look for chips, a cable that pulls and what touches the bar there, run the circle again",
    Name.BORE: "check bore, holder, how the plate sits and the zero point, press the holder home, run the circle again",
    Name.FORM: "check tilt, plane (G17) and radius in the program and how the plate sits, run the circle again",
    Name.REPEATED: "ask the gauge less often: the rate in the instrument's file, or what the display renews; run the circle again",
    Name.COPIED: "this is no circle of its own: look at what was imported or played back, and measure it",
    Name.SCALE: "check the gauge at a gauge block and its counts per millimetre, then the feed-in of plan and program; run the circle again",
    Name.CLOSURE: "tighten holder and ball, let bar and machine warm through, run the circle again",
    Name.DRIFT: "tighten holder and ball, let bar and machine warm through, run the circle again",
    Name.NOISE: "clean balls and cups, look for what shakes, run the circle again",
    Name.OTHER_DIRECTION: "ball or holder moved since the other direction: press them home, run both again",
    Name.LOCAL: "clean balls and cups, look for what touches the bar there, run both again",
    Name.PROGRAMS: "look which way the machine turns and where it begins, check G2, G3, mirroring and turned axes (G51.1, G68); mend it and "
    "begin a new session: every circle of this one is wrong in the same way",
    Name.BAR: "put the bar on its calibrator, check its certificate and that no extension was changed; then every circle is to be measured again",
    Name.REPEAT: "ball or holder moved since the run before: press them home, run it again",
    Name.SINCE: "look what was changed at the machine since",
}
"""Remedies at the machine, in the shop's words."""


def found(name: Name, value: float, limit: float, sound: str, wrong: str = "", short: str = "") -> Finding:
    """Return the finding that follows from value and limit.

    Args:
        sound: the description of a sound run.
        wrong: the description of a fault, if `sound` does not describe it too. The remedy follows it.
    """
    unit = UNITS.get(name, "µm")
    if value > limit:
        return Finding(name, value, limit, unit, FindingVerdict.WRONG, f"{wrong or sound}: {DO[name]}", short)
    return Finding(name, value, limit, unit, FindingVerdict.GOOD, sound, short)


def undecided(name: Name, why: str, value: float | None = None, limit: float | None = None, short: str = "") -> Finding:
    """Return an undecided finding with its reason."""
    return Finding(name, value, limit, UNITS.get(name, "µm"), FindingVerdict.CANNOT_TELL, why, short)


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
