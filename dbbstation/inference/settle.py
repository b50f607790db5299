"""Find the laws and patterns that explain a channel: compare, search, refine, repeat; the outcome with its noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import logsumexp

from dbbstation.inference.alternatives import in_place_of
from dbbstation.inference.bank import Bank, alike, amplitudes_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import NEGATIVE_SIGMA, Kind, Variable, beyond_reach, impossible, impossible_beside
from dbbstation.inference.hypotheses import Hypothesis, SearchWork, search
from dbbstation.inference.looks import MOVED, places_anew, seen
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.patterns import patterns, wander
from dbbstation.inference.read_off import moved, values_of_law
from dbbstation.inference.triangle import rms, squares

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.facts.value import Value
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.coloured import Coloured
    from dbbstation.inference.hypotheses import Posterior
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison
    from dbbstation.inference.patterns import Pattern
    from dbbstation.inference.projection import BesideBase


class Beginning(Enum):
    """Initial noise models, by the causes whose residual gives the first noise.

    All are tried, because wandering noise resembles curves, smooth effects resemble noise, and pulses resemble outliers.
    """

    EVERYTHING = "everything"
    EVERYTHING_LONG_TAILS = "everything, then with long tails"
    NOTHING = "nothing"
    NOTHING_LONG_TAILS = "nothing, with long tails"


@dataclass(frozen=True, eq=False, kw_only=True)
class Outcome:
    """The outcome of a comparison of sets of causes.

    Attributes:
        stopped: whether the search ended early; the result is then the best so far.
    """

    causes: tuple[Cause, ...]
    comparison: ModelComparison
    posterior: Posterior
    stopped: bool = False

    @property
    def best(self) -> Hypothesis:
        """Return the selected hypothesis."""
        return self.posterior.best


@dataclass(frozen=True, eq=False, kw_only=True)
class Settled(Outcome):
    """The outcome with its noise."""

    channel: Channel
    bank: Bank
    noise: Coloured
    refused: Mapping[str, str] = field(default_factory=dict)
    beginning: Beginning = Beginning.EVERYTHING
    log_probability: float = 0.0
    others: tuple[Settled, ...] = ()

    @property
    def weighted(self) -> list[tuple[Settled, float]]:
        """Return the outcomes from all initial noise models, with their probabilities."""
        every = [self, *self.others]
        logs = np.array([one.log_probability for one in every])
        return list(zip(every, np.exp(logs - logsumexp(logs)).tolist(), strict=True))

    def effect(self, names: Collection[str] | None = None, members: Sequence[Member] | None = None) -> Floats:
        """Return the effect of some members over all rows, in the residual's unit, shape (n,).

        Args:
            members: members to fit together; None for the best ones.
        """
        total, members = np.zeros(len(self.channel.residual)), self.best.members if members is None else members
        for member, values, _ in self.comparison.estimated(members):
            if names is None or member.name in names:
                total += self.bank.samples(member.columns) @ values
        return total

    def base_values(self, effect: Floats | None = None) -> Floats:
        """Return the refitted base's values, shape (k,), given an effect; None for all members' effect."""
        return self.bank.base_values(self.effect() if effect is None else effect)

    def predicted(self) -> Floats:
        """Return the sum of base and members over all rows, shape (n,)."""
        effect = self.effect()
        return effect + self.channel.base.samples @ self.base_values(effect)

    @cached_property
    def left(self) -> Floats:
        """Return the residual beside the members, over all rows, shape (n,)."""
        return self.channel.residual - self.predicted()

    def probability(self, names: Collection[str]) -> float:
        """Return the probability that at least one cause is present, averaged over initial noise models.

        Args:
            names: causes; found patterns of one family over equal variables count together.
        """
        kinds, total = {self.bank.kind_of(name) for name in names}, 0.0
        for one, share in self.weighted:
            alike = [] if one is self else [c.name for c in one.causes if one.bank.kind_of(c.name) in kinds]
            total += share * one.posterior.probability([*names, *alike])
        return min(1.0, total)  # it can round to more


BETTER = 3.0
"""Log odds of a clear improvement, a factor of twenty. Each scan of the residual must add so much, noise included, to
be followed by another; formula inaccuracy must add so much to be reported."""


@dataclass(frozen=True)
class _How:
    """Options of a comparison; fields before `progress` are options of `settle`."""

    look: bool = True
    most_expanded: int = BOUNDS.expanded_of_table
    most_looks: int = BOUNDS.looks
    in_time: bool = True
    thorough: bool = True
    progress: Callable[[str], None] = lambda _: None
    work: SearchWork = field(default_factory=SearchWork)

    def part(self, stages: int) -> _How:
        """Return one stage's options, with its share of the work."""
        return replace(self, work=self.work.part(stages))


def settle(
    channel: Channel,
    *,
    beginnings: Sequence[Beginning] = tuple(Beginning),
    rivals: bool = True,
    most_work: float = np.inf,
    **options: Any,  # noqa: ANN401 - fields of `_How`
) -> Settled:
    """Compare sets of laws and patterns.

    Args:
        rivals: whether noise with any spectrum competes; False for first-order noise, estimated with all causes.
        most_work: limit of all searches together, see `SearchWork`.
        options: `look`: search waves, bumps, steps and pulses. `most_expanded`: limit of one search. `most_looks`: number
            of successive scans of the residual. `in_time`: search steps and pulses in time; False if blocks have separate
            curves. `thorough`: several starts and a final scan; False for one fast search. `progress`: called with each
            stage.
    """
    how, stages = _How(**options, work=SearchWork(most_work)), len(beginnings) + 1
    if not rivals:
        return _settled(_begun(channel), how)
    found: list[Settled] = []
    laid_out = _begun(channel)
    begun: tuple[Bank, Settled] | None = None
    # Long tails come last, and only if innovations may have them.
    for number, one in enumerate(sorted(beginnings, key=lambda one: one in LONG_TAILS)):
        if one in LONG_TAILS and found and not _may_have_long_tails(laid_out, found):
            continue
        share = stages - number
        if one in BESIDE_NOTHING:
            found.append(_from(laid_out.copy(), (), one, how.part(share), found))
            continue
        if begun is None:
            # The comparison with all causes is computed once and continued for each kind of noise. Beside all causes
            # the noise is too small, so that scans take most of a fast search and find noise.
            bank, first = laid_out.copy(), replace(how, look=how.look and how.thorough)
            begun, share = (bank, _settled(bank, first.part(share))), share - 1
        found.append(_from(begun[0].copy(), begun[1].best.members, one, how.part(share), found))
    found.sort(key=lambda one: -one.log_probability)
    return replace(found[0], others=tuple(found[1:]))


def _may_have_long_tails(laid_out: Bank, found: Sequence[Settled]) -> bool:
    if any(one.bank.may_have_long_tails(one.best.members) for one in found):
        return True
    bank = laid_out.copy()
    bank.measures_beside_members = True
    bank.measure(())
    return bank.may_have_long_tails(())


BESIDE_NOTHING = (Beginning.NOTHING, Beginning.NOTHING_LONG_TAILS)
LONG_TAILS = (Beginning.EVERYTHING_LONG_TAILS, Beginning.NOTHING_LONG_TAILS)


def _from(
    bank: Bank,
    members: tuple[Member, ...],
    beginning: Beginning,
    how: _How,
    known: Sequence[Settled],
) -> Settled:
    bank.measures_beside_members, bank.long_tails = True, beginning in LONG_TAILS
    settled = _settled(bank, how, members, known)
    if settled.bank is not bank:
        return replace(settled, beginning=beginning)
    return replace(settled, beginning=beginning, log_probability=log_probability(bank, settled.best.members))


def _meets(one: Settled, other: Settled) -> bool:
    kinds = [sorted(each.bank.kind_of(name) for name in each.best.names) for each in (one, other)]
    if kinds[0] != kinds[1] or one.bank.long_tails != other.bank.long_tails:
        return False
    apart = one.predicted() - other.predicted()
    return rms(apart) < BOUNDS.noise_settled * other.noise.sigma


def static_patterns(channel: Channel) -> tuple[Pattern, ...]:
    """Return patterns that need no search, independent of held-back rows."""
    found = patterns(channel.variables, channel.blocks, channel.time, channel.simulated, channel.time_unit)
    if channel.time is not None:
        row = Variable("row", channel.time_unit, Kind.TIME, channel.time)
        clock = next((v for v in channel.variables if v.values is channel.time), row)
        found += wander(clock, channel.blocks)
    return tuple(found)


def _begun(channel: Channel) -> Bank:
    bank = Bank(channel)
    bank.add(static_patterns(channel) if channel.static is None else channel.static)
    return bank


def _settled(
    bank: Bank,
    how: _How,
    best: tuple[Member, ...] = (),
    known: Sequence[Settled] = (),
) -> Settled:
    channel, look, work = bank.channel, how.look, how.work
    seeds: dict[frozenset[str], tuple[Member, ...]] = {}
    laid_out: set[str] = set()
    looked: set[frozenset[str]] = set()
    compared: Settled | None = None  # after the last scan
    most_probable, times_placed = -np.inf, 0
    # Starting members come from a comparison whose residual was already scanned.
    blank = not best
    # Laws come first, at their best values, so scans see only their residual.
    looking = look and not channel.laws
    for number in range(BOUNDS.rounds):
        _measured(bank, best, work)
        starts: list[tuple[Member, ...]] = []
        if looking:
            best, starts = _looked_about(bank, best, how, first=blank and compared is None)
            if compared is not None and _would_be_the_same(compared, bank, best):
                return compared
        how.progress(f"sets of causes, round {number + 1}")
        beside = bank.beside()
        comparison = beside.comparison(bank.target)
        causes = bank.causes
        starts = [grown(comparison, causes, members, work) for members in (*starts, best)]
        posterior = search(comparison, causes, [*starts, *seeds.values()], how.most_expanded, work=work)
        seeds |= {h.names: h.members for h in posterior.hypotheses[: BOUNDS.seeds]}
        settled = met = Settled(
            channel=channel,
            bank=bank,
            noise=bank.noise,
            causes=causes,
            comparison=comparison,
            posterior=posterior,
            refused=dict(bank.refused),
        )
        best = posterior.best.members
        compared = settled if looking else None
        if rough := _rough(settled, laid_out, work):
            laid_out |= {member.name for member in rough}
            _lay_out(bank, beside, posterior.best, rough)
            continue
        if cannot := _impossible(settled):
            bank.refused |= cannot
            continue
        if times_placed < BOUNDS.placed and (moved := _placed(bank, best)):
            times_placed += 1
            best = moved
            continue
        met = next((one for one in known if _meets(settled, one)), settled)
        seen_before = looking and (not how.thorough or posterior.best.names in looked)
        if not look or met is not settled or work.is_spent or seen_before:
            break
        if looking:
            looked.add(posterior.best.names)
            # Scans that only find other places for one effect do not improve the probability.
            before, most_probable = most_probable, max(most_probable, log_probability(bank, best))
            if most_probable < before + BETTER:
                break
        looking = look
    return replace(met, stopped=True) if work.is_spent else met


def _rough(settled: Settled, laid_out: Collection[str], work: SearchWork) -> list[Member]:
    on_grid = {m.name for m in settled.best.members if m.variant.nonlinear and not m.variant.tangents}
    known = set(laid_out) - on_grid
    return [] if work.is_spent else [m for m in _laws_of(settled) if m.name not in known]


def _placed(bank: Bank, members: tuple[Member, ...]) -> tuple[Member, ...]:
    named = {member.name for member in members} & bank.looked_for
    better = places_anew(bank, members, {name for name in named if bank.patterns[name].family in MOVED})
    return better if [one.name for one in better] != [one.name for one in members] else ()


def _would_be_the_same(compared: Settled, bank: Bank, best: Sequence[Member]) -> bool:
    there = {cause.name: cause.variants for cause in bank.causes}
    before = {cause.name: cause.variants for cause in compared.causes}
    same = {member.name for member in best} == compared.best.names and there == before
    return same and alike(bank.noise, compared.noise)


def _measured(bank: Bank, members: Sequence[Member], work: SearchWork) -> Coloured:
    work.fit(len(bank.channel.target), bank.count)
    return bank.measure(members)


def _looked(
    bank: Bank,
    members: tuple[Member, ...],
    how: _How,
    *,
    in_time: bool = True,
) -> tuple[Member, ...]:
    before, work = log_probability(bank, members), how.work
    for number in range(how.most_looks):
        if work.is_spent:
            break
        known = set(bank.patterns)
        new = bank.add(seen(bank, members, in_time=in_time))
        work.fit(len(bank.channel.target), bank.count)
        noise = _measured(bank, members, work)
        how.progress(f"look {number + 1}: {len(members)} causes, noise about {noise.sigma:.3g}")
        comparison = bank.beside().comparison(bank.target)
        more = places_anew(bank, grown(comparison, bank.causes, members, work), set(new))
        fresh = set(bank.patterns) - known
        taken = {member.name for member in more}
        # Added causes reduce the noise, and less noise admits more causes, so both together must be more probable than
        # before.
        if bank.measures_beside_members:
            _measured(bank, more, work)
        after = log_probability(bank, more)
        if not taken & fresh or after <= before:
            bank.drop(fresh)
            _measured(bank, members, work)
            break
        bank.drop(fresh - taken)
        members, before = more, after
    return members


def _looked_about(
    bank: Bank,
    best: tuple[Member, ...],
    how: _How,
    *,
    first: bool,
) -> tuple[tuple[Member, ...], list[tuple[Member, ...]]]:
    starts: list[tuple[Member, ...]] = []
    if first and how.in_time and how.thorough:
        # Stretches of time can imitate effects with memory, and curves over time can imitate sudden effects. Separate
        # starts therefore include effects over variables, and sudden effects with laws only. Several laws together can
        # imitate a sudden effect beside one of them, so another start has the strongest law alone.
        comparison = bank.beside().comparison(bank.target)
        begun = grown(comparison, bank.causes)
        starts.append(_looked(bank, begun, how, in_time=False))
        laws = tuple(member for member in begun if member.name in bank.laws)
        starts.append(_looked(bank, laws, how) if laws else ())
        if len(laws) > 1:
            alone = comparison.scan((), [cause for cause in bank.causes if cause.name in bank.laws])
            starts.append(_looked(bank, (alone.best[int(alone.log_odds.argmax())],), how))
    best = _looked(bank, best, how, in_time=how.in_time)
    return best, starts


def log_probability(bank: Bank, members: Sequence[Member]) -> float:
    """Return the log probability of noise and members, up to a constant."""
    odds = sum(member.log_odds for member in members)
    evidence = bank.beside().comparison(bank.target, np.unique(all_columns(members))).log_evidence(members)
    return bank.log_likelihood() + evidence + bank.tails_beyond(members) + odds


def grown(
    comparison: ModelComparison,
    causes: Sequence[Cause],
    start: Sequence[Member] = (),
    work: SearchWork | None = None,
) -> tuple[Member, ...]:
    """Add causes greedily, then prune, and return the members.

    Args:
        start: initial members; unknown ones are skipped.
        work: counter of scans.
    """
    there = {cause.name: cause for cause in causes}
    members = [
        replace(m, cause=there[m.name])
        for m in start
        if m.name in there and any(v is m.variant for v in there[m.name].variants)
    ]
    while len(members) < BOUNDS.grown:
        if work is not None:
            work.scan(causes)
        scan, _ = comparison.around(members, causes).without(())
        if not scan.causes:
            break
        k = int(scan.log_odds.argmax())
        if scan.log_odds[k] <= 0.0:
            break
        members.append(scan.best[k])
    while members:
        each = comparison.each_beside_others(members)
        members = [member for member, _, _ in each]
        worth = np.array([factor + member.cause.log_prior_odds for member, factor, _ in each])
        if worth.min() > 0.0:
            break
        members.pop(int(worth.argmin()))
    return tuple(members)


def _laws_of(settled: Settled) -> list[Member]:
    best, laws = settled.best, settled.bank.laws
    found = [m for m in best.members if m.name in laws]
    rivals = [cause for cause in settled.causes if cause.name in laws]
    for member in best.members:
        found += in_place_of(member.name, settled, rivals)
    return list({m.name: m for m in found}.values())


def _lay_out(bank: Bank, beside: BesideBase, best: Hypothesis, rough: Sequence[Member]) -> None:
    for member in rough:
        _lay_out_one(bank, beside, best, member)


def _lay_out_one(bank: Bank, beside: BesideBase, best: Hypothesis, member: Member) -> None:
    target, law = bank.target, bank.laws[member.name]
    others = best.without(member.name)
    begun = (
        _between_points(bank, beside, others, member) if len(law.grids) == 1 and not len(member.variant.slack) else None
    )
    for number in range(BOUNDS.steps if law.grids or law.at else 1):
        values = _values(beside, target, (member, *others))[: len(member.columns)]
        width = member.width
        if not values[:width].any():
            return
        nonlinear = moved(law, member, values) if number or begun is None else begun
        every = np.zeros(len(law.plausible))
        every[amplitudes_of(member.variant)] = values[:width]
        bank.refine(law.name, nonlinear, every)
        cause = next(cause for cause in bank.causes if cause.name == law.name)
        same = next(v for v in cause.variants if v.label == member.variant.label and v.nonlinear == nonlinear)
        member = replace(member, cause=cause, variant=same)


def _values(beside: BesideBase, target: Floats, members: Sequence[Member]) -> Floats:
    """Return members' values, computed from their columns alone."""
    return beside.comparison(target, np.unique(all_columns(members))).values(members)


def _between_points(bank: Bank, beside: BesideBase, others: Sequence[Member], member: Member) -> tuple[float, ...]:
    law, target = bank.laws[member.name], bank.target
    if others:
        values = _values(beside, target, (member, *others))[len(member.columns) :]
        target = target - bank.fitted(all_columns(others)) @ values
    axes = bank.axes
    target = target - axes @ (axes.T @ target)
    used = amplitudes_of(member.variant)

    def explained(value: float) -> float:
        columns = bank.whitened(law.columns((value,))[:, used])
        columns = columns - axes @ (axes.T @ columns)
        return squares(columns @ np.linalg.lstsq(columns, target, rcond=None)[0])

    (grid,), (value,) = law.grids, member.variant.nonlinear
    at = int(np.argmin(np.abs(np.subtract(grid, value))))
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    for _ in range(2):
        places = [value, *np.linspace(low, high, BOUNDS.places).tolist()]
        value = places[int(np.argmax([explained(one) for one in places]))]
        step = (high - low) / (BOUNDS.places - 1)
        low, high = max(value - step, grid[0]), min(value + step, grid[-1])
    return (value,)


def _impossible(settled: Settled) -> dict[str, str]:
    members, laws = settled.best.members, settled.bank.laws
    found: dict[str, str] = {}
    own: dict[str, dict[str, Value]] = {}
    for member, values, covariance in settled.comparison.estimated(members):
        name, width = member.name, member.width
        if name not in laws:
            continue
        effect = settled.bank.samples(member.variant.columns) @ values[:width]
        # What is there by one amplitude is not there by less than nothing: its shape would be moved until it is another law.
        least = 0.0 if width == 1 else NEGATIVE_SIGMA
        why = impossible(laws[name], member.variant, values, covariance, least)
        if why := why or beyond_reach(laws[name], float(np.std(effect))):
            found[name] = why
        own[name] = values_of_law(laws[name], member, values, covariance, laws[name].form_uncertainty)
    every = {parameter: value.value for values in own.values() for parameter, value in values.items()}
    beside = {name: impossible_beside(laws[name], values, every) for name, values in own.items()}
    return {name: why for name, why in beside.items() if why} | found
