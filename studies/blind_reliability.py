"""Reliability of verdicts: do probabilities come true?

Forecasts are sorted into bins of probability and compared with outcomes [Murphy and Winkler, Applied Statistics 26 (1977)
41].
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.levels import ABSENT
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
    """A forecast of one cause or indistinguishable causes, and its truth.

    Attributes:
        probability: 0 to 1.
        log_evidence: conditional log Bayes factor, or None.
        right: it or an equivalent is hidden.
        perturbed: the hidden effect follows its law only roughly.
    """

    probability: float
    log_evidence: float | None
    right: bool
    perturbed: bool


def equivalents(source: Mapping[str, Any]) -> frozenset[str]:
    """Return a source with its observational equivalents."""
    return frozenset({source["name"], *(source.get("class") or ())})


def forecasts(
    sources: Iterable[Mapping[str, Any]], hidden: Collection[str], *, perturbed: bool = False
) -> tuple[Forecast, ...]:
    """Return one session's forecasts.

    An equivalence class counts once, with its largest probability. `not-testable` counts only above the prior.

    Args:
        sources: of a diagnosis's summary.
        perturbed: the hidden effect follows its law only roughly.
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
    """Return tables of bins by group; None without probabilities."""
    if not said:
        return None
    groups = {title: [one for one in said if belongs(one)] for title, belongs in _GROUPS.items()}
    return {title: bins_of(group) for title, group in groups.items() if group}


def sure(said: Sequence[Forecast]) -> dict[str, Any]:
    """Return the right share of forecasts of 0.95 to 1."""
    return share_of(one.right for one in said if one.probability >= SURE)


def share_of(flags: Iterable[bool]) -> dict[str, Any]:
    """Return the true count, total, and the share's 95 % interval."""
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


def bins_of(said: Sequence[Forecast]) -> list[dict[str, Any]]:
    """Return one entry per bin, lower edge included."""
    place = np.digitize([one.probability for one in said], BINS[1:-1])
    table = []
    for k, (low, high) in enumerate(pairwise(BINS)):
        inside = [one for one, at in zip(said, place, strict=True) if at == k]
        mean = float(np.mean([one.probability for one in inside])) if inside else None
        table.append({"from": low, "to": high, "mean_probability": mean, **share_of(one.right for one in inside)})
    return table
