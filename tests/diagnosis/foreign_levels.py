"""The three levels of a session against what was put in: does anything differ, what does it follow, which cause."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from studies.blind_figure import reliability_figure
from studies.blind_reliability import Forecast, bins_of, forecasts
from tests.diagnosis.table.levels_study import interval
from tests.plant.blind.limits import TESTABLE_SIGMA

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

SAID = ("follows", "goes on in time", "happened")
"""Answers by which a class of variables is said to be followed."""

UNLISTED = {"wandering-bar": {"time"}, "stick-slip": {"strut-speed-sign", "reversal"}}
"""Variables of what is on no list."""

LEVELS = ("differs", "follows", "which cause")

LOUD = 100.0
"""Log Bayes factor from which on a cause should not be missed."""

REVERSAL = {"strut-speed-sign", "reversal"}
MEANS = {
    "the time of the session": {"time"},
    "temperature": {"time"},
    "run": {"time"},
    "a ball put up elsewhere": {"time"},
    "the bar's length": {"time"},
    "strut-speed-sign": REVERSAL,
    "travel since its reversal": REVERSAL,
    "time since its reversal": REVERSAL,
    "joint-angle": {"joint"},
    "joint-angle-speed-sign": {"joint", "strut-speed-sign"},
    "base-compliance": {"strut-force"},
    "strut-weight": {"strut-force"},
    "angle since the start": {"time"},
    "reading": {"reading", "angle"},
    "bar-scale": {"reading"},
}
"""Variables of the plant that one of the program's stands for, where it has another name: of the warm-ups that were put in, temperatures
follow the time."""


def levels_of(answer: Mapping[str, Any], summary: Mapping[str, Any]) -> dict[str, Any]:
    """One session: which effects were located, and which classes are those of an effect."""
    said = summary.get("levels")
    if said is None:
        return {}
    effects = {one["name"]: set(one.get("variables") or UNLISTED[one["name"]]) for one in answer["effects"]}
    classes = [one for one in said["follows"] if one["answer"] in SAID]
    told = [told_of(one) for one in classes]
    every = set[str]().union(*effects.values())
    listed = {one["name"] for one in answer["effects"] if one.get("listed", True)}
    return {
        "differs": said["differs"]["answer"],
        "loud": sorted(one["name"] for one in answer["effects"] if one["listed"] and log_bayes_factor(one) > LOUD),
        "effects": sorted(effects),
        "located": sorted(name for name, own in effects.items() if any(own & one for one in told)),
        "classes": [" and ".join(_names(one)) for one in classes],
        "wrong_classes": [" and ".join(_names(one)) for one, own in zip(classes, told, strict=True) if not own & every],
        "forecasts": {
            "differs": [[said["differs"]["probability"], bool(effects)]],
            "follows": [[one["probability"], bool(told_of(one) & every)] for one in said["follows"]],
            "which cause": [[one.probability, one.right] for one in forecasts(summary["sources"], listed)],
        },
        "held_out_um": [[one["before"], one["after"]] for one in classes if one["before"] is not None],
    }


def log_bayes_factor(effect: Mapping[str, Any]) -> float:
    """Return a cause's log Bayes factor beside all others, from the plant's sensitivities.

    Its size is s standard deviations. A prior of k amplitudes that is as wide as the effect costs k/2 log(1 + s^2 / k).
    """
    square, count = (TESTABLE_SIGMA * effect["size"]) ** 2, max(len(effect["amplitudes"]), 1)
    return float(0.5 * square - 0.5 * count * np.log1p(square / count))


def table_of(rows: Mapping[str, Mapping[str, Any]], head: Mapping[str, Any], limits: str) -> dict[str, Any]:
    """Recall and precision of each level, in the form of the validation page.

    Args:
        rows: of one commit, by session.
        head: command, date and seed.
    """
    every = [row for row in rows.values() if row["levels"]]
    there = [row for row in every if row["levels"]["effects"]]
    nothing = [row for row in every if not row["levels"]["effects"]]
    listed, names = sum(row["listed"] for row in there), sum(len(row["named"]) for row in every)
    wrong = sum(not name.startswith("(") for row in every for name in row["wrong"])
    loud = [(row, name) for row in there for name in row["levels"]["loud"]]
    figures = {
        "sessions with effects: it differs": _rate([row["levels"]["differs"] == "yes" for row in there]),
        "sessions with effects: no": _rate([row["levels"]["differs"] == "no" for row in there]),
        "sessions without: it differs": _rate([row["levels"]["differs"] == "yes" for row in nothing]),
        "effects that a class follows": _share(
            sum(len(row["levels"]["located"]) for row in there), sum(len(row["levels"]["effects"]) for row in there)
        ),
        "classes that no effect follows": _share(
            sum(len(row["levels"]["wrong_classes"]) for row in every),
            sum(len(row["levels"]["classes"]) for row in every),
        ),
        "listed causes that were named": _share(sum(len(row["right"]) for row in there), listed),
        "wrong names": _share(wrong, names),
        f"log Bayes factor above {LOUD:g}: a class follows": _rate([n in row["levels"]["located"] for row, n in loud]),
        f"log Bayes factor above {LOUD:g}: named": _rate([name in row["right"] for row, name in loud]),
        f"log Bayes factor above {LOUD:g}: named or in an ambiguity": _rate(
            [name in row["right_or_unsure"] for row, name in loud]
        ),
        "sessions without: a name": _rate([bool(row["named"]) for row in nothing]),
    }
    if ratios := [row["held_out_over_true"] for row in there if row.get("held_out_over_true")]:
        middle, high = np.percentile(ratios, (50.0, 95.0))
        figures["held-out error over that of the causes put in"] = [
            f"{len(ratios)} sessions",
            f"median {middle:.2f}",
            f"95th percentile {high:.2f}",
        ]
    return {
        "question": "How often is each of the three levels correct for circles?",
        **head,
        "data": f"{_sessions(every)}, {len(nothing)} of them clean.",
        "limits": limits,
        "columns": ["counted", "share", "95 % interval"],
        "figures": figures,
    }


def calibration_of(rows: Mapping[str, Mapping[str, Any]], head: Mapping[str, Any]) -> tuple[dict[str, Any], bytes]:
    """Return how often each level's probabilities come true, in the form of the validation page, and as a diagram."""
    judged = [row for row in rows.values() if row["levels"]]
    every = [row["levels"]["forecasts"] for row in judged]
    bins = {
        level: bins_of([Forecast(p, None, right, perturbed=True) for one in every for p, right in one[level]])
        for level in LEVELS
    }
    return {
        "question": "Are the stated probabilities of the three levels correct for circles?",
        **head,
        "data": f"{_sessions(judged)}.",
        "limits": "Cells: right of all with such a probability, and the 95 % interval of their share.",
        "columns": list(LEVELS),
        "figures": {
            f"{of[0]['from']:g} to {of[0]['to']:g}": [
                f"{one['hits']} of {one['count']}"
                + (f", {interval(one['hits'], one['count'])}" if one["count"] else "")
                for one in of
            ]
            for of in zip(*bins.values(), strict=True)
        },
    }, reliability_figure(bins)


def told_of(one: Mapping[str, Any]) -> set[str]:
    """Return the plant's variables that a class stands for."""
    return set[str]().union(*(MEANS.get(name, {name}) for name in _names(one)))


def _names(one: Mapping[str, Any]) -> Sequence[str]:
    return [*(name for names in one["variables"] for name in names), *one["or_variables"]]


def _sessions(rows: Sequence[Mapping[str, Any]]) -> str:
    robots = len({row["robot"] for row in rows})
    return f"{len(rows)} sessions of {robots} simulated robots whose laws are not the program's own"


def _rate(each: Sequence[bool]) -> list[str]:
    return _share(sum(each), len(each))


def _share(count: int, of: int) -> list[str]:
    return [f"{count} of {of}", f"{100.0 * count / max(of, 1):.0f} %", interval(count, of) or "none"]
