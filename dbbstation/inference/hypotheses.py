"""Search sets of causes and compute their posterior probabilities.

A set's log posterior is its log marginal likelihood, averaged over variants and sizes, plus log prior odds. The search
adds, removes and exchanges causes until all neighbours of likely sets are examined.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import log_ndtr, logsumexp

from dbbstation.computing.grouped import grouped
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.model_comparison import SLACK_SHARES, Member, slices_of, with_slack_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.model_comparison import Around, Cause, ModelComparison, Scan, Variant


SCAN, FIT = 1.0 / 3.0, 3e5
"""Work per column of a scan, and multiplications of a fit per unit of work. The unit is one cause times one column of
an examined set, 16 µs. With 1,200 rows and 1,100 columns, sets of 16 causes took 12 ms, scans of 500 columns 2.5 ms,
fits 80 ms."""


@dataclass(eq=False)
class SearchWork:
    """Counted work of a search: examined sets, scans of all causes, and fits.

    Attributes:
        most: limit of the work.
        whole: counter of the total work, which includes this part.
    """

    most: float = np.inf
    spent: float = 0.0
    whole: SearchWork | None = None

    def examine(self, members: Sequence[Member]) -> None:
        """Count one examined set: causes times columns."""
        self._spend(len(members) * sum(len(member.columns) for member in members))

    def scan(self, causes: Iterable[Cause], times: int = 1) -> None:
        """Count scans of all causes."""
        self._spend(times * SCAN * sum(len(one.columns) for cause in causes for one in cause.variants))

    def fit(self, rows: int, columns: int) -> None:
        """Count one fit of all columns, rows times squared columns."""
        self._spend(rows * float(columns) ** 2 / FIT)

    def _spend(self, work: float) -> None:
        self.spent += work
        if self.whole is not None:
            self.whole._spend(work)  # noqa: SLF001 - of the same class

    def part(self, stages: int) -> SearchWork:
        """Return one stage's work limit: an even share of the remaining work."""
        return SearchWork(max(self.most - self.spent, 0.0) / stages, whole=self)

    @property
    def is_spent(self) -> bool:
        """Return whether the work is used up."""
        return self.spent >= self.most


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes.

    Attributes:
        log_factors: averaged log Bayes factor of each member, given the others.
    """

    members: tuple[Member, ...]
    log_posterior: float
    log_factors: tuple[float, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """Return names of its causes."""
        return frozenset(member.name for member in self.members)

    @property
    def lean(self) -> bool:
        """Return whether every member's Bayes factor outweighs its prior odds."""
        return all(odds > 0.0 for odds in self.log_odds)

    @property
    def log_odds(self) -> list[float]:
        """Return each member's log odds, given the others."""
        return [f + m.cause.log_prior_odds for m, f in zip(self.members, self.log_factors, strict=True)]

    def without(self, *names: str) -> tuple[Member, ...]:
        """Return the members without the named ones."""
        return tuple(member for member in self.members if member.name not in names)

    def log_factor(self, name: str) -> float:
        """Return a member's log Bayes factor, given the others."""
        return next(f for m, f in zip(self.members, self.log_factors, strict=True) if m.name == name)


@dataclass(frozen=True, eq=False)
class Posterior:
    """Posterior probabilities of sets of causes.

    Attributes:
        weights: log posteriors of all relevant sets.
        at_limit: whether a set beyond the size limit would be better; common members stay certain.
    """

    hypotheses: tuple[Hypothesis, ...]
    weights: dict[frozenset[str], float]
    at_limit: bool = False

    @property
    def best(self) -> Hypothesis:
        """Return the selected set, usually the most probable one."""
        return self.hypotheses[0]

    @cached_property
    def shares(self) -> Floats:
        """Return the probability of each set, in the order of `weights`, shape (s,)."""
        weights = np.array(list(self.weights.values()))
        return np.exp(weights - logsumexp(weights))

    @cached_property
    def sets_of(self) -> dict[str, Integers]:
        """Return the places of each cause's sets in `shares`, by name in order."""
        found = grouped((name, place) for place, names in enumerate(self.weights) for name in names)
        return {name: np.array(found[name]) for name in sorted(found)}

    def inside(self, names: Iterable[str]) -> Flags:
        """Return which sets have at least one cause, shape (s,)."""
        found = np.zeros(len(self.weights), dtype=bool)
        for name in names:
            found[self.sets_of.get(name, [])] = True
        return found

    def led_by(self, best: Hypothesis) -> Posterior:
        """Return the posterior with another set first."""
        return replace(self, hypotheses=(best, *(one for one in self.hypotheses if one.names != best.names)))

    def probability(self, names: Iterable[str]) -> float:
        """Return the probability that at least one cause is present."""
        # Rounding can make a partial sum exceed the whole.
        return min(1.0, float(self.shares[self.inside(names)].sum()))


def search(
    comparison: ModelComparison,
    causes: Sequence[Cause],
    seeds: Iterable[Sequence[Member]] = (),
    most_expanded: int = BOUNDS.expanded,
    most_members: int | None = None,
    likely: float = BOUNDS.likely,
    *,
    thorough: bool = True,
    work: SearchWork | None = None,
) -> Posterior:
    """Search the sets of causes and return their posterior.

    Args:
        seeds: further sets to examine, such as earlier ones.
        most_expanded: most sets whose neighbours are examined.
        most_members: largest size of a set; None for no limit.
        likely: expand sets within these log odds of the best; `BOUNDS.close` to find only the best.
        thorough: also replace two members by one, and one by two.
        work: limit of counted work, at which the best set so far is returned; None for no limit.
    """
    limit = np.inf if most_members is None else most_members
    named = {cause.name: cause for cause in causes}
    return _Search(comparison, named, most_expanded, limit, likely, thorough, work or SearchWork()).run(seeds)


@dataclass(eq=False)
class _Search:
    comparison: ModelComparison
    causes: Mapping[str, Cause]
    most: int
    most_members: float
    likely: float
    thorough: bool
    work: SearchWork
    seen: dict[frozenset[str], Hypothesis] = field(default_factory=dict)
    scored: dict[frozenset[str], float] = field(default_factory=dict)
    beyond: float = -np.inf  # log posterior of the most probable set that is too large
    room: int = BOUNDS.scores
    top: float = -np.inf  # log posterior of the most probable hypothesis so far
    begun: bool = False  # seeds are examined without a limit, because they are the best so far

    def run(self, seeds: Iterable[Sequence[Member]]) -> Posterior:
        """Search until all likely sets are examined."""
        self._grow(seeds)
        self._drop_negligible()
        weights = {**self.scored, **{key: h.log_posterior for key, h in self.seen.items()}}
        found = tuple(sorted(self.seen.values(), key=lambda h: -h.log_posterior))
        return Posterior(found, weights, at_limit=self.beyond > self.top)

    def _grow(self, seeds: Iterable[Sequence[Member]]) -> None:
        self._look_at(())
        for members in seeds:
            self._look_at([self._anew(member) for member in members if member.name in self.causes])
        self.begun = True
        self._pairs((), self.comparison.scan((), self.causes.values()))
        expanded: set[frozenset[str]] = set()
        challenged: set[frozenset[str]] = set()
        while len(expanded) < self.most and not self.work.is_spent:
            waiting = [
                h
                for key, h in self.seen.items()
                if key not in expanded and h.log_posterior > self.top - self.likely and h.lean
            ]
            if waiting:
                best = max(waiting, key=lambda h: h.log_posterior)
                expanded.add(best.names)
                self._expand(best)
                continue
            best = max(self.seen.values(), key=lambda h: h.log_posterior)
            if best.names in challenged or not self.thorough:
                break
            challenged.add(best.names)
            self._challenge(best)

    def _expand(self, hypothesis: Hypothesis) -> None:
        around = self._around(hypothesis)
        self._try_more(hypothesis.members, hypothesis.log_posterior, around.without(())[0])
        for member, factor in zip(hypothesis.members, hypothesis.log_factors, strict=True):
            others = hypothesis.without(member.name)
            without = hypothesis.log_posterior - factor - member.cause.log_prior_odds
            self._score(others, without)
            self._try_more(others, without, around.without([member.name])[0])

    def _challenge(self, hypothesis: Hypothesis) -> None:
        around = self._around(hypothesis)
        for pair in self._least_worth(hypothesis):
            others = hypothesis.without(*pair)
            scan, evidence = around.without(pair)
            k = int(scan.log_odds.argmax())
            if self._may_be_likely(others, evidence, float(scan.log_odds[k])):
                self._look_at([*others, scan.best_of(k)])
        for member in hypothesis.members:
            if member.cause.named and member.width < BOUNDS.flexible:
                continue
            scan = around.without([member.name])[0]
            self._pairs(hypothesis.without(member.name), scan)
            if not member.cause.named:
                self._name(hypothesis, member.name, scan)

    def _name(self, hypothesis: Hypothesis, unnamed: str, scan: Scan) -> None:
        """Try named causes in place of an unnamed effect, each with the best addition, because no law is quite followed."""
        others = hypothesis.without(unnamed)
        enough = 0.5 * hypothesis.log_factor(unnamed)
        named = [
            k for k in np.argsort(-scan.log_factor).tolist() if scan.causes[k].named and scan.log_factor[k] > enough
        ]
        for k in named[: BOUNDS.rivals]:
            instead = [*others, scan.best_of(k)]
            self.work.scan(self.causes.values())
            beside = self.comparison.around(instead, self.causes.values()).without(())[0]
            one = int(beside.log_odds.argmax())
            self._look_at([*instead, beside.best_of(one)])

    def _least_worth(self, hypothesis: Hypothesis) -> list[tuple[str, str]]:
        worth = dict(zip((m.name for m in hypothesis.members), hypothesis.log_factors, strict=True))
        pairs = combinations(sorted(worth), 2)
        return sorted(pairs, key=lambda pair: worth[pair[0]] + worth[pair[1]])[: BOUNDS.replaced]

    def _around(self, hypothesis: Hypothesis) -> Around:
        self.work.scan(self.causes.values(), len(hypothesis.members) + 1)
        return self.comparison.around(hypothesis.members, self.causes.values())

    def _try_more(self, members: Sequence[Member], log_posterior: float, scan: Scan) -> None:
        worth = scan.log_odds
        for k in np.flatnonzero(log_posterior + worth > self.top - BOUNDS.negligible).tolist():
            self._score([*members, scan.best_of(k)], log_posterior + float(worth[k]), worth=float(worth[k]))

    def _score(self, members: Sequence[Member], log_posterior: float, worth: float = 1.0) -> None:
        if len(members) > self.most_members:
            self.beyond = max(self.beyond, log_posterior)
            return
        if log_posterior > self.top - BOUNDS.negligible:
            self.scored.setdefault(frozenset(member.name for member in members), log_posterior)
            if len(self.scored) > self.room:
                self._drop_negligible()
        if worth > 0.0 and log_posterior > self.top - self.likely:
            self._look_at(members)

    def _drop_negligible(self) -> None:
        self.scored = {key: score for key, score in self.scored.items() if score > self.top - BOUNDS.negligible}
        self.room = max(BOUNDS.scores, 2 * len(self.scored))

    def _pairs(self, members: Sequence[Member], scan: Scan) -> None:
        hidden = {c.name for c, odds in zip(scan.causes, scan.log_odds, strict=True) if odds <= 0.0}
        # A hidden cause seems small alone, but may have its plausible size given the cause that hides it.
        named = [
            replace(member, scale=1.0) if member.name in hidden else member
            for member in (*scan.best, *scan.narrow)
            if member is not None and member.cause.named
        ]
        if len(named) > BOUNDS.paired:
            worth = dict(zip((c.name for c in scan.causes), scan.log_factor.tolist(), strict=True))
            named = sorted(named, key=lambda member: -worth[member.name])[: BOUNDS.paired]
        pairs, evidence = self.comparison.log_evidence_of_pairs(members, named)
        causes = np.array([id(member.cause) for member in named])
        apart = np.flatnonzero(causes[pairs[:, 0]] != causes[pairs[:, 1]])
        odds = np.array([member.cause.log_prior_odds for member in named])
        worth = evidence + odds[pairs].sum(axis=1)
        best = apart[np.argsort(-worth[apart])]
        # A flexible form imitates two causes, so pairs of inflexible causes are examined separately.
        widths = np.array([member.width for member in named])
        stiff = best[widths[pairs[best]].max(axis=1) < BOUNDS.flexible]
        alone = self.comparison.log_evidence(members)
        for some in (best, stiff):
            for k in some[: BOUNDS.paired_hypotheses].tolist():
                if self._may_be_likely(members, alone, worth[k] - alone):
                    self._look_at([*members, *(named[one] for one in pairs[k])])

    def _may_be_likely(self, members: Sequence[Member], evidence: float, worth: float) -> bool:
        return evidence + sum(member.log_odds for member in members) + worth > self.top - BOUNDS.negligible

    def _anew(self, member: Member) -> Member:
        cause, old = self.causes[member.name], member.variant
        same = [v for v in cause.variants if (v.label, v.law) == (old.label, old.law)] or list(cause.variants)

        def away(variant: Variant) -> float:
            return float(np.abs(np.subtract(variant.nonlinear, old.nonlinear)).sum())

        return Member(cause, min(same, key=away), member.scale)

    def _look_at(self, members: Sequence[Member]) -> None:
        key = frozenset(member.name for member in members)
        if key in self.seen or len(key) > self.most_members or (self.begun and self.work.is_spent):
            return
        self.work.examine(members)
        found = self._settled(list(members))
        self.seen[key] = found
        self.top = max(self.top, found.log_posterior)
        if not found.lean:
            self._look_at(found.without(found.members[int(np.argmin(found.log_odds))].name))

    def _settled(self, members: list[Member]) -> Hypothesis:
        many = len(members) > BOUNDS.many
        single = [
            k
            for k, member in enumerate(members)
            if many and len(member.cause.variants) == 1 and not len(member.variant.slack)
        ]
        beside = _Beside(self.comparison, members)
        for _ in range(BOUNDS.sweeps if len(members) > 1 else 1):
            before, at_once = list(members), beside.each_of(members, single)
            for k, member in enumerate(before):
                if k in at_once:
                    members[k] = at_once[k][0]
                    continue
                comparison, others = beside.others(members, k)
                members[k] = comparison.scan(others, [member.cause]).best_of(0)
            members = self._with_slack(beside.local, members)
            if all(
                one.variant is was.variant and one.scale == was.scale for one, was in zip(members, before, strict=True)
            ):
                break
        members, more = self._as_close_as_it_is(beside, members)
        evidence, factors = beside.log_evidence(members), []
        possible = self._possible(beside.local, members)
        more += sum(possible)
        at_once = beside.each_of(members, single)
        for k, member in enumerate(members):
            if k in at_once:
                _, averaged, best = at_once[k]
                factors.append(averaged + possible[k])
                more += averaged - best
                continue
            comparison, others = beside.others(members, k)
            scan = comparison.scan(others, [member.cause])
            averaged = float(scan.log_factor[0] - scan.log_best[0])
            factors.append(evidence - comparison.log_evidence(others) + averaged + possible[k])
            more += averaged
        odds = sum(member.cause.log_prior_odds for member in members)
        return Hypothesis(tuple(members), evidence + more + odds, tuple(factors))

    def _possible(self, comparison: ModelComparison, members: list[Member]) -> list[float]:
        """Return the members' log Bayes factors for non-negative amplitudes."""
        # The factor is the posterior over the prior probability of positive values, one half.
        found = [0.0] * len(members)
        if not any(any(member.variant.positive) for member in members):
            return found
        estimates = comparison.estimates(members)
        sigma = np.sqrt(np.diag(estimates.covariance))
        for k, (member, own) in enumerate(zip(members, slices_of(members), strict=True)):
            for j in np.flatnonzero(member.variant.positive) + own.start:
                found[k] += float(log_ndtr(estimates.values[j] / sigma[j]) + np.log(2.0))
        return found

    def _as_close_as_it_is(self, beside: _Beside, members: list[Member]) -> tuple[list[Member], float]:
        """Return members with their best laws and slack shares, and the log gain of averaging over shares."""
        more = 0.0
        for k, member in enumerate(members):
            if len(member.variant.slack) == member.variant.tangents:
                continue
            best, gain = member, -np.inf
            for one in (member, *_by_other_laws(beside, members, k)):
                tried = _by_shares(one)
                evidence = [beside.log_evidence([*members[:k], each, *members[k + 1 :]]) for each in tried]
                averaged = float(logsumexp(evidence)) - float(np.log(len(tried)))
                if averaged + one.variant.log_weight > gain:
                    gain = averaged + one.variant.log_weight
                    best, over_shares = tried[int(np.argmax(evidence))], averaged - max(evidence)
            members[k] = best
            more += over_shares
        return members, more

    def _with_slack(self, comparison: ModelComparison, members: list[Member]) -> list[Member]:
        if not any(len(member.variant.slack) for member in members):
            return members
        values, places = comparison.values(members), slices_of(members)
        return [with_slack_of(m, values[own][: m.width]) for m, own in zip(members, places, strict=True)]


class _Beside:
    """Evaluation of one set's members given each other; the largest member is eliminated only once.

    Attributes:
        local: comparison of their causes only.
    """

    def __init__(self, comparison: ModelComparison, members: Sequence[Member]) -> None:
        self.local = comparison.among(member.cause for member in members)
        self._largest = max(range(len(members)), key=lambda k: len(members[k].columns), default=0)
        self._last: tuple[Member, ModelComparison] | None = None

    def others(self, members: Sequence[Member], k: int) -> tuple[ModelComparison, list[Member]]:
        """Return a comparison and members that together represent all members but one."""
        if k == self._largest:
            return self.local, [*members[:k], *members[k + 1 :]]
        first = self._largest
        return self._beside_largest(members), [m for j, m in enumerate(members) if j not in {k, first}]

    def log_evidence(self, members: Sequence[Member]) -> float:
        """Return the log marginal likelihood of all members."""
        if not members:
            return self.local.log_evidence(members)
        first = self._largest
        return self._beside_largest(members).log_evidence([*members[:first], *members[first + 1 :]])

    def each_of(self, members: Sequence[Member], which: Sequence[int]) -> dict[int, tuple[Member, float, float]]:
        """Return scans of some members' present variants given the other members, by place [`each_beside_others`]."""
        return dict(zip(which, self.local.each_beside_others(members, which), strict=True)) if which else {}

    def _beside_largest(self, members: Sequence[Member]) -> ModelComparison:
        largest = members[self._largest]
        if self._last is None or self._last[0] is not largest:
            self._last = largest, self.local.beside_of(largest)
        return self._last[1]


def _by_shares(member: Member) -> list[Member]:
    """Return a member once with each pair of shares of its slack; differences between parts have their own share if there are any."""
    return [
        replace(
            member,
            slack_share=share,
            parts_share=of_parts,
            slack_scale=member.slack_scale * share / member.slack_share,
        )
        for share, of_parts in SLACK_SHARES
        if member.variant.parts or share == of_parts
    ]


def _by_other_laws(beside: _Beside, members: Sequence[Member], k: int) -> list[Member]:
    """Return a member once with each other law that has slack columns, because scans compare laws without slack."""
    if not (causes := other_laws(members[k], lambda variant: len(variant.slack) > 0)):
        return []
    comparison, others = beside.others(members, k)
    return [replace(one, cause=members[k].cause) for one in comparison.scan(others, causes).best]


def other_laws(member: Member, wanted: Callable[[Variant], bool] = lambda _: True) -> list[Cause]:
    """Return one cause per law that a member does not use, named after the law, with the wanted forms."""
    others = (variant for variant in member.cause.variants if variant.law != member.variant.law and wanted(variant))
    laws = grouped((variant.law, variant) for variant in others)
    return [replace(member.cause, name=law, variants=tuple(some)) for law, some in laws.items()]
