"""Measured circles with their figures, and what `circles --json` prints of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from dbbstation.circles.analysis import EDITION
from dbbstation.circles.budget import budgets, pair_budgets
from dbbstation.circles.quick_look import quick_look
from dbbstation.circles.summary import circle_summary, pair_summary, quick_look_summary
from dbbstation.quality.limits import FALSE_ALARMS_PER_RUN
from dbbstation.quality.summary import findings_summary
from dbbstation.results.frame import Framed
from dbbstation.results.serialise import Absent, AsItIs, Kept

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


@dataclass(frozen=True, kw_only=True, eq=False)
class CirclesResult(Framed):
    """Figures of measured circles after ISO 230-4, as `circles --json` prints them.

    Attributes:
        edition: of the standard.
        filter: of G, F and H, in words.
        reference_circle: about which each figure is taken.
        false_alarms_per_run: that the limits of findings are made for.
        runs: figures of each circle with their budgets, by key as docs/circles.md has them; lengths in µm.
        pairs: the same of both directions together.
        quick_look: signatures of serial axes; None where they were not asked for.
        circles: the circles themselves, with their analyses.
    """

    edition: str
    filter: str
    reference_circle: Mapping[str, str]
    false_alarms_per_run: float
    runs: tuple[Mapping[str, Any], ...]
    pairs: tuple[Mapping[str, Any], ...]
    quick_look: Annotated[tuple[Mapping[str, Any], ...] | None, Absent] = None
    circles: Annotated[Circled, AsItIs, Kept] = field(repr=False)

    def rows(self) -> list[dict[str, object]]:
        """Every number of every circle, one row for each."""
        return [_flattened(run) for run in self.runs]


def circles_result(found: Circled, chosen: Filter, *, quick_look: bool = False) -> CirclesResult:
    """Return the figures of circles.

    Args:
        found: the circles.
        chosen: filter that they were worked out with.
        quick_look: look for signatures of serial axes.
    """
    numbers = circled_summary(found, chosen)
    return CirclesResult(
        **{**numbers, "runs": tuple(numbers["runs"]), "pairs": tuple(numbers["pairs"])},
        quick_look=tuple(quick_looks(found)) if quick_look else None,
        circles=found,
        notes=found.warnings,
    )


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


def _flattened(run: Mapping[str, Any]) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in run.items():
        match value:
            case str() | int() | float():
                found[key] = value
            case {"max": _, "min": _} | {"x": _, "y": _}:
                found |= {f"{key.removesuffix('_um')}_{part}_um": number for part, number in value.items()}
            case _:
                pass
    for harmonic in run.get("harmonics", ()):
        found[f"harmonic_{harmonic['undulations']}_um"] = harmonic["amplitude_um"]
    for step in run.get("reversal_steps", ()):
        found[f"step_at_{step['theta_deg']:.0f}_deg_um"] = step["height_um"]
    if run.get("closure"):
        found["closure_um"] = run["closure"]["height_um"]
    if run.get("noise_um"):
        found["noise_um"] = run["noise_um"]["of_a_reading"] or ""
    for figure, budget in run.get("uncertainty", {}).items():
        plain = figure.lower().replace("(", "_").replace(")", "").replace(" ", "_")
        found[f"u_{plain}_um"] = "" if budget["u_um"] is None else budget["u_um"]
    for finding in run.get("findings", ()):
        found[f"finding_{finding['name'].replace(' ', '_')}"] = finding["verdict"]
    return found
