"""Find the law of a class of variables by held-out scores."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, product
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.followed import followed_by
from dbbstation.inference.impossible import impossible
from dbbstation.inference.levels import JOINED, LawForm, ScoredLaw
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.triangle import left_by, squares, triangle_of
from dbbstation.inference.verdict import SURELY, DensityGains

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.inference.followed import VariableClass
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settled import Settled


def law_form(
    settled: Settled,
    one: VariableClass,
    parts: Sequence[Flags] | None,
    refuted: Collection[str] = (),
) -> LawForm:
    """Score the single causes over a class of variables, and the best set's sum of causes.

    A part's score is the log evidence of all rows minus the log evidence without the part, for equal noise. A law is
    named if it is surely better than every other candidate and than no law, even without its best part. If a sum is
    best, each of its laws is tested against alternatives.

    A more flexible candidate that contains a law predicts about as well. The evidence of all rows penalises amplitudes
    and may refute the candidate; otherwise the law stays open.

    Args:
        parts: rows of each part, shape (n,); None to decide by the evidence of all rows.
        refuted: causes that held-out rows refute, so they are not named.
    """
    barred = settled.bank.nameless | set(refuted)
    whole = _place(settled, one.members, one.wanted, parts, barred)
    if whole.name is not None or len(one.members) == 1:
        return whole
    each = {name: _place(settled, {name}, one.wanted, parts, barred) for name in sorted(one.members)}
    rivals = {name: form.not_worse for name, form in each.items() if form.name != name}
    return replace(whole, together=tuple(name for name in each if name not in rivals), rivals=rivals)


def _place(
    settled: Settled,
    names: Collection[str],
    wanted: Collection[str],
    parts: Sequence[Flags] | None,
    barred: Collection[str],
) -> LawForm:
    every = zip(settled.best.members, settled.best.log_odds, strict=True)
    others = tuple(member for member, odds in every if member.name not in names and odds >= SURELY)
    candidates, worth = _candidates(settled, names, wanted, others)
    scores = (
        _scores(settled, candidates, others, parts) if parts else {name: np.array([w]) for name, w in worth.items()}
    )
    totals = {name: float(np.sum(score)) for name, score in scores.items()}
    order = sorted(totals, key=lambda name: -totals[name])
    alive = [name for name in order if not _is_worse(scores[order[0]], scores[name], parts)]
    best = max(alive, key=lambda name: worth[name])
    if best not in names:
        # Among causes equal for these rows, the name in the most probable set stays.
        own = (name for name in alive if name in names)
        best = next((n for n in own if _are_the_same(settled, candidates[n], candidates[best], others)), best)
    not_worse, same = list[str](), list[str]()
    for name in order:
        if name == best or _is_worse(scores[best], scores[name], parts):
            continue
        contains = _contains(settled, candidates[name], candidates[best], others)
        refuted = worth[best] - worth[name] >= SURELY and (
            contains or _count(candidates[name]) > _count(candidates[best])
        )
        if not refuted:
            (same if contains else not_worse).append(name)
        elif contains and _are_the_same(settled, candidates[best], candidates[name], others):
            same.append(name)
    single = len(candidates[best]) == 1 and best not in barred
    named = single and not not_worse and _is_worse(scores[best], np.zeros(len(scores[best])), parts)
    return LawForm(
        best if named else None,
        tuple(same if named else [best, *(n for n in order if n in same or n in not_worse)]),
        tuple(ScoredLaw(n, totals[n]) for n in order),
    )


def _candidates(
    settled: Settled, names: Collection[str], wanted: Collection[str], others: Sequence[Member]
) -> tuple[dict[str, tuple[Member, ...]], dict[str, float]]:
    comparison, taken = settled.comparison, {m.name for m in others}
    rivals = [c for c in settled.causes if followed_by(settled.bank, c.name) & set(wanted) and c.name not in taken]
    scan = comparison.scan(others, rivals)
    worth = scan.log_odds
    possible = [k for k in np.argsort(-worth).tolist() if _is_possible(settled, scan.best[k], others)]
    best = {scan.causes[k].name: k for k in possible[: BOUNDS.candidates]}
    best |= {scan.causes[k].name: k for k in range(len(worth)) if len(names) == 1 and scan.causes[k].name in names}
    found: dict[str, tuple[Member, ...]] = {name: (scan.best[k],) for name, k in best.items()}
    # Compared sets include the inaccuracy of their formulas.
    weights, beside = settled.posterior.weights, frozenset(taken)
    values = {name: weights.get(beside | {name}, np.inf) - weights.get(beside, -np.inf) for name in best}
    values = {name: value if np.isfinite(value) else float(worth[best[name]]) for name, value in values.items()}
    own = tuple(m for m in settled.best.members if m.name in names)
    if len(own) == 1:
        found[own[0].name] = own
    else:
        name = JOINED.join(sorted(names))
        found[name] = own
        odds = sum(m.log_odds for m in own)
        values[name] = comparison.log_evidence((*own, *others)) - comparison.log_evidence(others) + odds
    return found, values


def _is_possible(settled: Settled, member: Member, others: Sequence[Member]) -> bool:
    if not any(member.variant.positive):
        return True
    _, values, covariance = settled.comparison.estimated([member, *others])[0]
    return not impossible(settled.bank.laws[member.name], values, np.diag(covariance))


def _is_worse(best: Floats, other: Floats, parts: Sequence[Flags] | None) -> bool:
    """Return whether the best candidate is surely preferred by all rows, or by held-out parts without its strongest part."""
    apart = DensityGains(tuple((best - other).tolist()))
    return apart.predicts if parts else apart.total >= SURELY


def _scores(
    settled: Settled,
    candidates: dict[str, tuple[Member, ...]],
    others: Sequence[Member],
    parts: Sequence[Flags],
) -> dict[str, Floats]:
    """Return each candidate's conditional log evidence of the parts, relative to no candidate, shape (parts,)."""
    bank = settled.bank
    every = np.unique(all_columns((*others, *chain.from_iterable(candidates.values()))))
    whole = bank.beside().comparison(bank.target, every)
    found: dict[str, list[float]] = {name: [] for name in candidates}
    for rows in parts:
        rest = bank.without(rows, every)
        nothing = whole.log_evidence(others) - rest.log_evidence(others)
        for name, members in candidates.items():
            both = (*members, *others)
            found[name].append(whole.log_evidence(both) - rest.log_evidence(both) - nothing)
    return {name: np.array(score) for name, score in found.items()}


def _contains(settled: Settled, one: Sequence[Member], other: Sequence[Member], others: Sequence[Member]) -> bool:
    bank = settled.bank
    own = all_columns(other)
    effect = bank.fitted(own) @ settled.comparison.estimates([*other, *others]).values[: len(own)]
    law = bank.laws.get(one[0].name) if len(one) == 1 else None
    parts = [bank.base, bank.fitted(all_columns((*others, *one)))]
    if law is not None and law.grids:
        parts += [bank.whitened(law.columns(point)) for point in product(*((grid[0], grid[-1]) for grid in law.grids))]
    widths = [part.shape[1] for part in parts]
    beside = widths[0] + len(all_columns(others))
    # An orthogonal transform keeps what each fit leaves: the triangle has as many rows as columns.
    rows = triangle_of(np.hstack([*parts, effect[:, None]]))
    always, *each = np.split(rows[:, :-1], [beside, *np.cumsum(widths)[1:-1]], axis=1)
    columns = (always, *(np.hstack([always, form]) for form in each))
    left, *alone = (squares(left_by(some, rows[:, -1])) for some in columns)
    return min(alone) <= (1.0 - EQUIVALENT**2) * left


def _are_the_same(settled: Settled, one: Sequence[Member], other: Sequence[Member], others: Sequence[Member]) -> bool:
    return _contains(settled, one, other, others) and _contains(settled, other, one, others)


def _count(members: Sequence[Member]) -> int:
    return sum(member.width + len(member.variant.nonlinear) for member in members)
