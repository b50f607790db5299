"""Decide which variables effects follow, with probabilities over all sets and held-out gains."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Kind
from dbbstation.inference.coloured import log_student
from dbbstation.inference.levels import RUN, SURE, TIME, DensityGains
from dbbstation.inference.looks import IN_TIME
from dbbstation.inference.model_comparison import all_columns, belong_to
from dbbstation.inference.patterns import Family
from dbbstation.inference.triangle import squares

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.inference.bank import Bank
    from dbbstation.inference.folds import HeldOutError
    from dbbstation.inference.levels import Gains
    from dbbstation.inference.model_comparison import Cause
    from dbbstation.inference.settle import Settled

LEAST_ADDED = 0.02
"""Least probability that a variable adds to its class; less does not change figures of two digits."""

WAYS = {
    **dict.fromkeys((Family.HYSTERESIS, Family.FRICTION, Family.SCALED), "direction"),
    **dict.fromkeys((Family.BY_DIRECTION, Family.PULSES_BY_DIRECTION), "direction"),
    **dict.fromkeys((Family.SPEED, Family.LAG, Family.MEMORY, Family.DEAD_TIME, Family.INTEGRAL), "late"),
    **dict.fromkeys((Family.DRIFT, Family.WANDER, *IN_TIME), "in_time"),
}
VALUE = "value"
AT_ONCE = (VALUE, "direction")
"""Ways without memory of earlier rows, which imitates drifts."""


@dataclass(frozen=True, eq=False)
class WithoutPart:
    """The selection without one part."""

    rows: Flags
    settled: Settled
    name: str = ""
    _known: dict[frozenset[str], tuple[float, float]] = field(default_factory=dict)

    def predicted(self, without: Iterable[str] = ()) -> tuple[float, float]:
        """Return log density and squared error of the part, with all members but some refitted to the other parts."""
        key = frozenset(without)
        if key not in self._known:
            left = left_without(self.settled, key)
            self._known[key] = log_density(self.settled, self.rows, left), squares(left[self.rows])
        return self._known[key]

    @cached_property
    def follow(self) -> Callable[[str], frozenset[str]]:
        """Return the function from causes to followed variables."""
        return follow_of(self.settled)


def followed_by(bank: Bank, name: str) -> frozenset[str]:
    """Return variables that a cause follows; for a user's law without variables, its name."""
    of, law = bank.of(name), bank.laws.get(name)
    if of is None:
        return frozenset({name})
    if law is not None and law.followed:
        return frozenset(law.followed)
    if of.family is Family.BLOCKS or (law is None and of.acts_once):
        return frozenset({RUN})
    if of.family in IN_TIME and not of.variables:
        return frozenset({TIME})
    return frozenset(TIME if v.kind is Kind.TIME else v.name for v in of.variables) or frozenset({name})


def way_of(bank: Bank, name: str) -> str:
    """Return how a cause follows its variables: by value, direction or delay."""
    of, law = bank.of(name), bank.laws.get(name)
    if law is not None and law.way:
        return law.way
    return VALUE if of is None or of.family is None else WAYS.get(of.family, VALUE)


def only_begun(settled: Settled) -> frozenset[str]:
    """Return uncertain members with memory whose effect is mostly the initial transient; these follow time."""
    channel, bank, found = settled.channel, settled.bank, set()
    members = settled.best.members
    remembering = {name for name, law in bank.laws.items() if law.family is Family.MEMORY}
    if not remembering.intersection(settled.best.names):
        return frozenset()
    axes = np.linalg.qr(channel.base.samples[channel.kept])[0]
    for member, own, _ in settled.comparison.estimated(members):
        count = member.width
        if member.name not in remembering or count < 2:  # noqa: PLR2004 - its gain and its initial states
            continue
        samples = bank.samples(member.variant.columns)[channel.kept]
        samples = samples - axes @ (axes.T @ samples)
        begun = np.sum(np.square(samples[:, 1:] @ own[1:count]))
        if begun > np.sum(np.square(samples[:, 0] * own[0])):
            found.add(member.name)
    return frozenset(name for name in found if settled.posterior.probability([name]) < SURE)


def follow_of(settled: Settled) -> Callable[[str], frozenset[str]]:
    """Return a function from causes to followed variables."""
    begun = only_begun(settled)
    return lambda name: frozenset({TIME}) if name in begun else followed_by(settled.bank, name)


def probability_of_any(settled: Settled) -> float:
    """Return the probability that at least one cause is present."""
    return min(1.0, sum(share * one.posterior.probability(one.posterior.sets_of) for one, share in settled.weighted))


class VariableProbabilities:
    """Probabilities of followed variables over all sets and initial noise models."""

    def __init__(self, settled: Settled) -> None:
        self._sets: dict[frozenset[str], float] = {}
        for one, share in settled.weighted:
            follow, posterior = follow_of(one), one.posterior
            for names, probability in zip(posterior.weights, posterior.shares.tolist(), strict=True):
                key = frozenset[str]().union(*(follow(name) for name in names))
                self._sets[key] = self._sets.get(key, 0.0) + share * probability

    def of(self, names: Iterable[str]) -> float:
        """Return the probability that at least one of these variables is followed."""
        wanted = set(names)
        return min(1.0, sum(p for key, p in self._sets.items() if key & wanted))

    def class_of(self, name: str) -> tuple[str, ...]:
        """Return a variable and its rivals, added until the class is sure."""
        chosen = [name]
        every = sorted(frozenset[str]().union(*self._sets))
        unsure = [other for other in every if self.of([other]) < SURE]
        while self.of(chosen) < SURE and len(chosen) < BOUNDS.variables_of_class:
            added = {other: self.of([*chosen, other]) - self.of(chosen) for other in unsure if other not in chosen}
            best = max(added, key=lambda other: added[other], default=None)
            if best is None or added[best] < LEAST_ADDED:
                break
            chosen.append(best)
        return tuple(chosen)


@dataclass(frozen=True)
class VariableClass:
    """A class of variables that the same members follow."""

    each: tuple[tuple[str, ...], ...]
    others: tuple[str, ...]
    members: frozenset[str]

    @property
    def wanted(self) -> frozenset[str]:
        """Return all variables of the class."""
        return frozenset(self.others).union(*self.each)


def classes_of(settled: Settled, probabilities: VariableProbabilities) -> list[VariableClass]:
    """Return classes of variables that the best set follows, most probable first."""
    follow = follow_of(settled)
    of = {member.name: follow(member.name) for member in settled.best.members}
    there = sorted(frozenset[str]().union(*of.values()), key=lambda v: (-probabilities.of([v]), v))
    found: list[VariableClass] = []
    for variable in there:
        if any(variable in one.wanted for one in found):
            continue
        own = probabilities.class_of(variable)
        members = frozenset(name for name, variables in of.items() if variables & set(own))
        others = tuple(v for v in interchangeable(settled, members, follow) if v not in own)
        same = next((k for k, one in enumerate(found) if one.members == members), None)
        if same is None:
            found.append(VariableClass((own,), others, members))
        else:
            one = found[same]
            found[same] = VariableClass((*one.each, own), tuple(dict.fromkeys((*one.others, *others))), members)
    return found


def interchangeable(
    settled: Settled, members: Collection[str], follow: Callable[[str], frozenset[str]]
) -> tuple[str, ...]:
    """Return variables of single causes without memory that can replace members."""
    own = frozenset[str]().union(*(follow(name) for name in members))
    found = in_place_of(settled, members, VALUE, lambda over: len(over) == 1 and not over & own)
    return tuple(sorted(frozenset[str]().union(*found)))


def in_place_of(
    settled: Settled, members: Collection[str], way: str, asked: Callable[[frozenset[str]], bool]
) -> list[frozenset[str]]:
    """Return the variables of single causes, not picked by a search, that can replace members.

    Args:
        way: how the causes follow their variables.
        asked: function that selects causes by their variables.
    """
    bank, rivals = settled.bank, []
    for cause in settled.causes:
        picked = cause.name in bank.looked_for or cause.name in settled.best.names
        if not picked and way_of(bank, cause.name) == way and asked(followed_by(bank, cause.name)):
            rivals.append(cause)
    shares = shares_of(settled, members, rivals)
    return [followed_by(bank, name) for name, share in shares.items() if share >= settled.channel.interchangeable]


def shares_of(settled: Settled, members: Collection[str], causes: Sequence[Cause]) -> dict[str, float]:
    """Return the share of the members' squares that each cause, in its best form, can explain."""
    if not causes:
        return {}
    columns, values, _ = estimated(settled, members)
    others = [m for m in settled.best.members if m.name not in members]
    found = {}
    for cause in causes:
        stiff = [one for one in cause.variants if len(one.columns) < BOUNDS.flexible] or cause.variants
        most = max(len(one.columns) for one in stiff)
        found[cause.name] = max(
            share_made(settled.comparison.beside(others, np.concatenate([columns, one.columns])), values)
            for one in stiff
            if len(one.columns) == most
        )
    return found


def estimated(settled: Settled, names: Collection[str]) -> tuple[Integers, Floats, Floats]:
    """Return some members' columns, their values, shape (p,), and covariance."""
    members = settled.best.members
    every = settled.comparison.estimates(members)
    inside = belong_to(members, names)
    return all_columns(members)[inside], every.values[inside], every.covariance[np.ix_(inside, inside)]


def share_made(products: Floats, values: Floats) -> float:
    """Return the share of an effect's squares that the columns after its own explain."""
    p = len(values)
    whole = float(values @ products[:p, :p] @ values)
    axes_of = np.linalg.pinv(products[p:, p:], rcond=1e-9, hermitian=True)
    towards = products[p:, :p] @ values
    return float(towards @ axes_of @ towards) / max(whole, 1e-300)


@dataclass(frozen=True)
class ClassGain:
    """Held-out gains of a class.

    Attributes:
        gains: increase of log density by the class.
    """

    gains: DensityGains
    before: float
    after: float

    @property
    def predicts(self) -> bool:
        """Return whether the class predicts: it gains surely without the best part, gains in half of the rows, and reduces the error."""
        return self.gains.predicts and self.gains.share_with_gain >= MOST_PARTS and self.after < self.before


MOST_PARTS = 0.5
"""Least share of held-out rows in parts with a gain: events in a few parts do not predict others."""


@dataclass(frozen=True, eq=False)
class ChosenWithoutParts:
    """Selections from a table, each with one part left out.

    Attributes:
        held_out: errors of each kind of effect, which may refute laws; None if not computed.
        ignored: predictions omit effects that follow only these variables.
    """

    parts: Sequence[WithoutPart]
    held_out: HeldOutError | None = None
    ignored: frozenset[str] = frozenset()

    @property
    def rows(self) -> Sequence[Flags]:
        """Return the parts' rows, shape (n,) each."""
        return [part.rows for part in self.parts]

    def gains_of(self, kinds: Collection[tuple[str, ...]]) -> Gains | None:
        """Return the summed gain of several kinds in each part; None if not computed."""
        return None if self.held_out is None else self.held_out.gains_of(kinds)

    def of(self, wanted: Collection[str] | None) -> ClassGain:
        """Return the gain of effects of these variables; None for all effects."""
        brought, before, after = [], 0.0, 0.0
        for part in self.parts:
            names, follow = part.settled.best.names, part.follow
            out = {name for name in names if follow(name) <= self.ignored}
            own = {name for name in names if wanted is None or follow(name) & set(wanted)}
            (density, error), (less, more) = part.predicted(out), part.predicted(out | own)
            brought.append(density - less)
            after += error
            before += more
        counts = tuple(int(rows.sum()) for rows in self.rows)
        mean = float(sum(counts))
        gains = DensityGains(tuple(brought), counts)
        return ClassGain(gains, float(np.sqrt(before / mean)), float(np.sqrt(after / mean)))

    def but_for(self, ignored: Collection[str]) -> ChosenWithoutParts:
        """Return the selections with other ignored variables."""
        return replace(self, ignored=frozenset(ignored))

    def errors_with(self, wanted: Collection[str]) -> list[float]:
        """Return each part's rms error with only effects of these variables, or with all effects if none are given."""
        # Effects in time may be the drift that belongs to a law over a variable.
        also = {TIME, RUN} if wanted and self.of({TIME, RUN}).predicts else set[str]()
        found = ((part.predicted(besides(part.settled, {*wanted, *also}, anew=True)), part) for part in self.parts)
        return [float(np.sqrt(error / part.rows.sum())) for (_, error), part in found]


def besides(one: Settled, wanted: Collection[str], *, anew: bool = False) -> set[str]:
    """Return members that follow none of these variables; none if no variables are given.

    Args:
        anew: whether a cause over these variables that can replace a member suffices. A selection without a part may give
            play of an axis the name of its screw.
    """
    follow, own = follow_of(one), frozenset(wanted)
    rest = {name for name in one.best.names if own and not follow(name) & own}
    ways = {name: way_of(one.bank, name) for name in rest} if anew else {}
    same = {n for n, way in ways.items() if way in AT_ONCE and in_place_of(one, [n], way, own.issuperset)}
    return rest - same


def left_without(one: Settled, names: Collection[str], unseen: Collection[str] = ()) -> Floats:
    """Return the residual after refitting all members but some, shape (n,).

    Args:
        unseen: members that are fitted but not predicted.
    """
    rest = one.best.without(*names)
    effect = one.effect(members=rest)
    shown = one.effect({m.name for m in rest} - set(unseen), rest) if unseen else effect
    return one.channel.residual - shown - one.channel.base.samples @ one.base_values(effect)


def log_density(one: Settled, rows: Flags, left: Floats) -> float:
    """Return the log density of a part's residual for the other parts' noise, up to a constant.

    Rows have the spacing of the noise estimate.
    """
    spaced = np.zeros(len(rows), dtype=bool)
    spaced[np.flatnonzero(rows)[:: one.channel.apart]] = True
    whitening = one.noise.whitening(replace(one.channel, kept=spaced).stretches)
    white = (left[spaced] if whitening is None else whitening @ left[spaced]) / one.noise.innovation
    if np.isfinite(one.bank.tails):
        return float(np.sum(log_student(white, one.bank.tails)))
    return -0.5 * float(white @ white)


def way_probability(settled: Settled, wanted: Collection[str], way: str) -> float:
    """Return the probability that a cause follows variables in the given way."""

    def inside(cause: Cause, one: Settled) -> bool:
        return bool(followed_by(one.bank, cause.name) & set(wanted)) and way_of(one.bank, cause.name) == way

    each = (
        share * one.posterior.probability([cause.name for cause in one.causes if inside(cause, one)])
        for one, share in settled.weighted
    )
    return min(1.0, float(sum(each)))  # rounding can make the sum exceed one
