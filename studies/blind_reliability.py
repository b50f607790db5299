"""Do causes that were given a probability come true as often as it says? Reliability of the verdicts of a blind study.

A reliability diagram sorts forecasts into bins of probability and compares each bin's mean forecast with how often it came
true [Murphy and Winkler, Applied Statistics 26 (1977) 41].
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.verdict import ABSENT
from studies.coverage import wilson

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

BINS = (0.0, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)
"""Edges between probabilities; the outermost are those at which a cause is ruled out and identified."""

SURE = BINS[-2]

MODEST = (3.0, 20.0)
"""Log Bayes factors at which a probability can be wrong: below, it is that of the prior; in the thousands, 0 or 1."""


@dataclass(frozen=True)
class Forecast:
    """What a diagnosis says of one cause, or of causes that no test tells apart, and whether it is true.

    Attributes:
        probability: that the cause is there, 0 to 1.
        log_evidence: conditional log Bayes factor of it; None where none is given.
        right: it, or one that is observationally equivalent to it, is hidden in the session.
        perturbed: what is hidden follows its law only roughly.
    """

    probability: float
    log_evidence: float | None
    right: bool
    perturbed: bool


def equivalents(source: Mapping[str, Any]) -> frozenset[str]:
    """Name of a source and of all that are observationally equivalent to it."""
    return frozenset({source["name"], *(source.get("class") or ())})


def forecasts(
    sources: Iterable[Mapping[str, Any]], hidden: Collection[str], *, perturbed: bool = False
) -> tuple[Forecast, ...]:
    """Forecasts of one session.

    A class of equivalent sources makes one, with the largest probability of its members. What is `not-testable` makes
    none where its probability is that of the prior; what the recordings made more probable than that, and left open,
    makes one. Verdicts without a probability make none.

    Args:
        sources: as in the summary of a diagnosis.
        perturbed: what is hidden follows its law only roughly.
    """
    best: dict[frozenset[str], Mapping[str, Any]] = {}
    for source in sources:
        if source.get("probability") is None:
            continue
        if source["verdict"] == "not-testable" and source["probability"] <= ABSENT:
            continue
        names = equivalents(source)
        if names not in best or source["probability"] > best[names]["probability"]:
            best[names] = source
    return tuple(
        Forecast(source["probability"], source.get("log_evidence"), not names.isdisjoint(hidden), perturbed)
        for names, source in best.items()
    )


def reliability(said: Sequence[Forecast]) -> dict[str, list[dict[str, Any]]] | None:
    """Tables of bins by which forecasts are in them; None where no verdict has a probability."""
    if not said:
        return None
    groups = {title: [one for one in said if belongs(one)] for title, belongs in _GROUPS.items()}
    return {title: _table(group) for title, group in groups.items() if group}


def sure(said: Sequence[Forecast]) -> dict[str, Any]:
    """Share of forecasts of 0.95 to 1 that are right."""
    return share_of(one.right for one in said if one.probability >= SURE)


def share_of(flags: Iterable[bool]) -> dict[str, Any]:
    """How many are true, of how many, with the 95 % interval of the share."""
    seen = [bool(flag) for flag in flags]
    count, hits = len(seen), sum(seen)
    low, high = wilson(hits / count, count) if count else (0.0, 1.0)
    return {"count": count, "hits": hits, "share": hits / count if count else None, "interval": [low, high]}


def _modest(one: Forecast) -> bool:
    return one.log_evidence is not None and MODEST[0] <= one.log_evidence <= MODEST[1]


_GROUPS: dict[str, Callable[[Forecast], bool]] = {
    "all verdicts": lambda _: True,
    f"log Bayes factor of {MODEST[0]:g} to {MODEST[1]:g}": _modest,
    "sessions with perturbed laws": lambda one: one.perturbed,
}


def _table(said: Sequence[Forecast]) -> list[dict[str, Any]]:
    """One entry per bin: the lower edge belongs to it, the upper one only in the last."""
    place = np.digitize([one.probability for one in said], BINS[1:-1])
    table = []
    for k, (low, high) in enumerate(pairwise(BINS)):
        inside = [one for one, at in zip(said, place, strict=True) if at == k]
        mean = float(np.mean([one.probability for one in inside])) if inside else None
        table.append({"from": low, "to": high, "mean_probability": mean, **share_of(one.right for one in inside)})
    return table
