"""The law of a class of variables, by held-out scores."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.bank import LOOKED_FOR
from dbbstation.inference.followed import followed_by
from dbbstation.inference.levels import LawForm, ScoredLaw
from dbbstation.inference.verdict import ABSENT, SURE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.inference.followed import VariableClass
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settled import Settled

MOST_CANDIDATES = 12
"""Causes that are scored in one place: worse ones by evidence of all rows predict no better."""

SURELY = float(np.log(SURE / ABSENT))


def law_form(settled: Settled, one: VariableClass, parts: Sequence[NDArray[np.bool_]]) -> LawForm:
    """Score single causes over a class's variables, and the best set's sum, in its place.

    A part's score is the log evidence of all rows less that without it. A law is named if it beats each rival surely,
    without its best part.
    """
    others = [m for m in settled.best.members if m.cause.name not in one.members]
    taken = {m.cause.name for m in others}
    rivals = [c for c in settled.causes if followed_by(settled.bank, c.name) & one.wanted and c.name not in taken]
    scan = settled.comparison.scan(others, rivals)
    worth = scan.log_factor + np.array([cause.log_prior_odds for cause in scan.causes])
    candidates: dict[str, tuple[Member, ...]] = {}
    for k in np.argsort(-worth)[:MOST_CANDIDATES]:
        candidates[scan.causes[k].name] = (scan.best[k],)
    for member in settled.best.members:
        if member.cause.name in one.members and (len(one.members) == 1 or member.cause.name in candidates):
            candidates[member.cause.name] = (member,)
    if len(one.members) > 1:
        candidates[" + ".join(sorted(one.members))] = settled.best.without(*taken)
    scores = _scores(settled, candidates, others, parts)
    totals = {name: float(np.sum(score)) for name, score in scores.items()}
    best = max(totals, key=lambda name: totals[name])
    order = sorted(totals, key=lambda name: -totals[name])
    not_worse = [name for name in order if name != best and not _is_worse(scores[best], scores[name])]
    same = [
        n
        for n in not_worse
        if " + " not in n and _cosine(settled, candidates[best], candidates[n], others) > EQUIVALENT
    ]
    pattern = settled.bank.patterns.get(best)
    picked = pattern is not None and pattern.family in LOOKED_FOR
    named = len(candidates[best]) == 1 and not picked and totals[best] > 0.0 and set(same) == set(not_worse)
    return LawForm(
        best if named else None,
        tuple(not_worse if named else [best, *not_worse]),
        tuple(ScoredLaw(n, totals[n]) for n in order),
    )


def _is_worse(best: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    apart = best - other
    return float(apart.sum() - max(apart.max(), 0.0)) >= SURELY


def _scores(
    settled: Settled,
    candidates: dict[str, tuple[Member, ...]],
    others: Sequence[Member],
    parts: Sequence[NDArray[np.bool_]],
) -> dict[str, NDArray[np.float64]]:
    """Return each part's conditional log evidence over an empty place, shape (parts,) each."""
    bank, kept = settled.bank, settled.channel.kept
    every = np.unique(np.concatenate([m.columns for ms in (others, *candidates.values()) for m in ms]))
    target = bank.target
    whole = bank.beside().comparison(target, every)
    found: dict[str, list[float]] = {name: [] for name in candidates}
    for rows in parts:
        out = rows[kept]
        rest = bank.beside(out, every).comparison(np.where(out, 0.0, target))
        nothing = whole.log_evidence(others) - rest.log_evidence(others)
        for name, members in candidates.items():
            both = (*members, *others)
            found[name].append(whole.log_evidence(both) - rest.log_evidence(both) - nothing)
    return {name: np.array(score) for name, score in found.items()}


def _cosine(settled: Settled, one: Sequence[Member], other: Sequence[Member], others: Sequence[Member]) -> float:
    """Return the least cosine between two causes' spans; zero for unequal sizes."""
    a, b = one[0].variant.columns, other[0].variant.columns
    if len(one) > 1 or len(other) > 1 or len(a) != len(b):
        return 0.0
    products = settled.comparison.beside(others, np.concatenate([a, b]))
    size = len(a)
    own, across, theirs = products[:size, :size], products[:size, size:], products[size:, size:]
    squares = np.linalg.pinv(own, hermitian=True) @ across @ np.linalg.pinv(theirs, hermitian=True) @ across.T
    return float(np.sqrt(np.clip(np.linalg.eigvals(squares).real.min(), 0.0, 1.0)))
