"""Measured circles with their figures, and what `circles --json` prints of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dbbstation.circles.analysis import EDITION
from dbbstation.circles.budget import budgets, pair_budgets
from dbbstation.circles.quick_look import quick_look
from dbbstation.circles.summary import circle_summary, pair_summary, quick_look_summary
from dbbstation.quality.limits import FALSE_ALARMS_PER_RUN
from dbbstation.quality.summary import findings_summary

if TYPE_CHECKING:
    from dbbstation.circles.analysis import CircleAnalysis, PairAnalysis
    from dbbstation.circles.budget import SetUpKnowledge
    from dbbstation.circles.path import Filter
    from dbbstation.files.recordings.entries import RunEntry
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.quality.judge import Judgement


@dataclass(frozen=True, eq=False)
class MeasuredCircle:
    """One accepted run.

    Attributes:
        session: name of its session.
        entry: what the session says of it.
        analysis: its figures; None where its recording shows no circle.
        problem: why it shows none; empty where it does.
        known: what the session states of bar and ball.
        judgement: what was found of it; None where it was not asked for.
    """

    session: str
    entry: RunEntry
    analysis: CircleAnalysis | None
    problem: str
    known: SetUpKnowledge
    judgement: Judgement | None


@dataclass(frozen=True, eq=False)
class MeasuredPair:
    """One circle in both directions.

    Attributes:
        one: run of the direction that was measured first.
        other: run of the other direction.
        analysis: figures of both.
    """

    one: MeasuredCircle
    other: MeasuredCircle
    analysis: PairAnalysis


@dataclass(frozen=True)
class Circled:
    """Circles of one or more sessions.

    Attributes:
        circles: in the order in which they were measured.
        pairs: both directions of one test, repeat and mounting.
        warnings: what was found beside.
        sessions: that were read.
    """

    circles: tuple[MeasuredCircle, ...]
    pairs: tuple[MeasuredPair, ...]
    warnings: tuple[str, ...]
    sessions: tuple[SessionFolder, ...]


def circled_summary(found: Circled, chosen: Filter) -> dict[str, Any]:
    """All figures of circles and pairs, with their budgets, as plain numbers: what `circles --json` prints.

    Args:
        found: the circles.
        chosen: filter that they were worked out with.
    """
    runs = []
    for circle in found.circles:
        entry = circle.entry
        run: dict[str, Any] = {
            "session": circle.session,
            "test": entry.test,
            "direction": str(entry.direction),
            "repeat": entry.repeat,
            "problem": circle.problem or None,
        }
        if circle.analysis is not None:
            run |= circle_summary(circle.analysis, budgets(circle.analysis, circle.known))
        if circle.judgement is not None:
            run["findings"] = findings_summary(circle.judgement.findings)
        runs.append(run)
    pairs = [
        {
            "session": pair.one.session,
            "test": pair.one.entry.test,
            "repeat": pair.one.entry.repeat,
            **pair_summary(pair.analysis, pair_budgets(pair.analysis, pair.one.known)),
        }
        for pair in found.pairs
    ]
    return {
        "edition": EDITION,
        "filter": chosen.words,
        "reference_circle": {"g_um": "minimum zone", "g_least_squares_um": "least squares", "f_um": "least squares"},
        "false_alarms_per_run": FALSE_ALARMS_PER_RUN,
        "runs": runs,
        "pairs": pairs,
    }


def quick_looks(found: Circled) -> list[dict[str, Any]]:
    """Signatures of serial axes in every circle, both directions of one together: what `circles --quick-look` prints.

    Args:
        found: the circles.
    """
    partner = {id(pair.one): pair.other for pair in found.pairs}
    second = {id(pair.other) for pair in found.pairs}
    looks = []
    for circle in found.circles:
        if circle.analysis is None or id(circle) in second:
            continue
        turns = [one for one in (circle, partner.get(id(circle))) if one is not None]
        looked = quick_look([one.analysis for one in turns if one.analysis is not None])
        looks.append(
            {
                "session": circle.session,
                "test": circle.entry.test,
                "repeat": circle.entry.repeat,
                "directions": [str(one.entry.direction) for one in turns],
                **quick_look_summary(looked),
            }
        )
    return looks
