"""Derive the three answers from a comparison and held-out parts, with detectable effects and laws of classes.

A column may be a consequence of the difference instead of its cause.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, product
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc, logsumexp

from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import EQUIVALENT
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.channel import Kind, impossible
from dbbstation.inference.coloured import FEWEST_INDEPENDENT, NOTHING, widening_of
from dbbstation.inference.followed import (
    VariableProbabilities,
    classes_of,
    estimated,
    followed_by,
    probability_of_any,
    way_probability,
)
from dbbstation.inference.left_over import SIGNIFICANT
from dbbstation.inference.levels import (
    JOINED,
    ONCE,
    RUN,
    SURE,
    SURELY,
    TIME,
    DensityGains,
    Detectable,
    DifferenceFound,
    Followed,
    FollowsAnswer,
    LawForm,
    Levels,
    ScoredLaw,
    corrects_of,
    difference_of,
)
from dbbstation.inference.model_comparison import LOG_SCALE_WEIGHTS, SCALES, all_columns
from dbbstation.inference.patterns import CURVES, Family
from dbbstation.inference.triangle import ROUNDING, left_by, norms, root, squares, triangle_of

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.inference.channel import Channel, Variable
    from dbbstation.inference.folds import KnownGains
    from dbbstation.inference.followed import ChosenWithoutParts, ClassGain, VariableClass
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.model_comparison import Cause, Member, Variant
    from dbbstation.inference.settle import Settled


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
    whole = _place_of(settled, one.members, one.wanted, parts, barred)
    if whole.name is not None or len(one.members) == 1:
        return whole
    each = {name: _place_of(settled, {name}, one.wanted, parts, barred) for name in sorted(one.members)}
    rivals = {name: form.not_worse for name, form in each.items() if form.name != name}
    return replace(whole, together=tuple(name for name in each if name not in rivals), rivals=rivals)


def _place_of(
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
    return not impossible(settled.bank.laws[member.name], member.variant, values, covariance)


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


POWER = 0.9
"""Share of effects of the detectable size that must be found."""

MARGIN = 1.25
"""Safety factor of the detectable size, for the uncertainty of noise and search odds. The complete analysis found 17 of
20 effects injected at the size with margin. Their probability alone was sure for 9, 10 and 10 of ten at factors 1, 1.25
and 1.5."""


def detectable(settled: Settled) -> tuple[Detectable, ...]:
    """Return detectable sizes of effects over variables and of the user's causes, before absorption by the base; the least detectable first."""
    asked: dict[str, Cause] = {}
    for cause in settled.causes:
        of = settled.bank.of(cause.name)
        bends = len(cause.variants[0].columns)
        if (of is not None and of.family not in FORMS) or bends > CURVES:
            continue
        key = ", ".join(sorted(followed_by(settled.bank, cause.name)))
        if key not in asked or bends > len(asked[key].variants[0].columns):
            asked[key] = cause
    found = [_over_variables(settled, key, cause) for key, cause in asked.items()]
    return _least_first(found)


def _least_first(found: list[Detectable]) -> tuple[Detectable, ...]:
    return tuple(sorted(found, key=lambda one: -np.inf if one.size is None else -one.size))


def detectable_causes(settled: Settled) -> tuple[Detectable, ...]:
    """Return detectable sizes of laws that have a confirming measurement and, at plausible size, an effect here."""
    laws, found = settled.bank.laws, list[Detectable]()
    for cause in (c for c in settled.causes if c.name in laws and laws[c.name].confirm):
        variant = cause.widest
        samples, white = settled.bank.samples(variant.columns), settled.bank.fitted(variant.columns)
        whole = squares(white * variant.plausible)
        if whole < (NOTHING * settled.noise.innovation) ** 2 * len(white):
            continue
        shown = np.diag(settled.comparison.beside((), variant.columns)) * settled.noise.innovation**2
        seen = float(variant.plausible**2 @ shown) / whole
        found.append(_detectable(settled, cause, variant, samples, seen, cause.name, laws[cause.name].confirm))
    return _least_first(found)


FORMS = (Family.CURVE, Family.LINEAR, Family.DRIFT, None)
"""Families of effects with a detectable size; laws of the user have none."""


def _over_variables(settled: Settled, follows: str, cause: Cause) -> Detectable:
    kept, variant = settled.channel.kept, cause.variants[0]
    samples = settled.bank.samples(variant.columns)[kept]
    samples = samples - samples.mean(axis=0)
    base = settled.channel.base.samples[kept]
    axes = np.linalg.qr(base / norms(base))[0]
    rest = samples - axes @ (axes.T @ samples)
    return _detectable(
        settled, cause, variant, samples, float(np.sum(rest**2) / max(np.sum(samples**2), 1e-300)), follows
    )


def _detectable(
    settled: Settled,
    cause: Cause,
    variant: Variant,
    samples: Floats,
    shown: float,
    follows: str,
    confirm: str | None = None,
) -> Detectable:
    size = None
    if shown >= ROUNDING:
        products = settled.comparison.beside(settled.best.without(cause.name), variant.columns)
        size = least_seen(products, samples, variant.plausible, cause.log_prior_odds + variant.log_weight)
    return Detectable(follows, None if size is None else MARGIN * size, float(np.clip(1.0 - shown, 0.0, 1.0)), confirm)


def least_seen(products: Floats, samples: Floats, plausible: Floats, log_odds: float) -> float | None:
    """Return the least rms at which the share `POWER` of random effects is surely found, or None.

    Args:
        products: information given base and others, shape (p, p).
    """
    # Amplitudes a and noise e, both N(0, 1), give z = L a + L^(1/2) e for the information L. The evidence is averaged
    # over `SCALES`, as for any cause.
    rng = np.random.default_rng(0)
    directions = rng.standard_normal((BOUNDS.detectable_draws, len(plausible)))
    size = np.sqrt(np.mean(np.square(directions @ samples.T), axis=1))
    information, axes = np.linalg.eigh(plausible[:, None] * products * plausible)
    information = np.maximum(information, 0.0)
    along = (directions / size[:, None] / plausible) @ axes
    noise = rng.standard_normal(along.shape)
    down = 1.0 + np.square(SCALES)[:, None] * information
    weights, constant = 0.5 * np.square(SCALES)[:, None] / down, LOG_SCALE_WEIGHTS - 0.5 * np.log(down).sum(axis=1)

    def power(level: float) -> float:
        towards = information * along * level + np.sqrt(information) * noise
        factors = np.square(towards) @ weights.T + constant
        return float(np.mean(np.logaddexp.reduce(factors, axis=1) + log_odds >= SURELY))

    low, high = 0.0, float(np.median(1.0 / np.maximum(np.sqrt(np.square(along) @ information), 1e-300)))
    for _ in range(MOST_DOUBLED):
        if power(high) >= POWER:
            break
        low, high = high, 2.0 * high
    else:
        return None
    for _ in range(HALVED):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if power(middle) >= POWER else (middle, high)
    return high


MOST_DOUBLED, HALVED = 30, 12
"""Steps of the search for a size: doublings over a factor of a billion, then halvings to a few thousandths."""


DETERMINED = 0.9
"""Share of a column's squares that the simulated value and its first two derivatives must explain for a column of the
motion itself, such as a torque. For a merely correlated column, such as a temperature, the share is smaller."""

CARRIES = 0.5
"""Share of the remaining squares that the difference and its derivatives must explain: more than all other variables together."""


def may_result(variable: Variable, channel: Channel) -> bool:
    """Return whether a column may be a consequence of the difference as well as its cause."""
    # A measured torque follows the actual motion and so contains the difference. A cause also contains it. These rows
    # cannot distinguish both.
    if channel.simulated is None or channel.time is None:
        return False
    kept, values = channel.kept, variable.values[channel.kept]
    simulated, carried = (
        _with_derivatives(values, channel.time, channel.blocks)[kept]
        for values in (channel.simulated.values, channel.residual)
    )
    whole = squares(values - values.mean())
    left, both = (squares(left_by(by, values)) for by in (simulated, np.hstack([simulated, carried])))
    if not ROUNDING * whole < left <= (1.0 - DETERMINED) * whole or both > (1.0 - CARRIES) * left:
        return False
    free = len(values) - simulated.shape[1] - carried.shape[1]
    more = carried.shape[1]
    return free > 0 and float(fdtrc(more, free, (left - both) / more / max(both / free, 1e-300))) < SIGNIFICANT


def _with_derivatives(values: Floats, time: Floats, blocks: Sequence[slice]) -> Floats:
    """Return a constant, values, and their first two derivatives by central differences, shape (n, 4)."""
    found = np.column_stack([np.ones(len(values)), values, np.zeros((len(values), 2))])
    for rows in blocks:
        if rows.stop - rows.start > 2 and np.all(np.diff(time[rows]) > 0.0):  # noqa: PLR2004 - a second difference
            found[rows, 2] = np.gradient(values[rows], time[rows])
            found[rows, 3] = np.gradient(found[rows, 2], time[rows])
    return found


SLOW = 10
"""Number of slowest frequencies of a stretch; their power is compared with the power of the next twice as many. Noise
with `FEWEST_INDEPENDENT` independent samples is flat over them."""

WAYS = ("value", "direction", "late", "in_time")


def levels_of(
    settled: Settled,
    left: LeftOver,
    parts: ChosenWithoutParts | KnownGains | None,
    matters: float | None = None,
    *,
    reference: float | None = None,
    worse: bool = False,
    sizes: tuple[Detectable, ...] | None = None,
) -> Levels:
    """Return the three answers.

    Args:
        reference: rms error on held-out parts without correction; None if not tested.
        worse: without held-out parts, whether the fitted sum leaves larger residuals than the reference.
        sizes: smallest detectable sizes for a known kind of noise; None to compute them over variables.
    """
    probabilities = VariableProbabilities(settled)
    every = classes_of(settled, probabilities)
    # Selections without a part may attribute a law's part, such as an integral's drift, to time.
    ways = [one.wanted for one in every if _in_time(one)] or [frozenset({TIME, RUN})]
    if parts is not None and not any(parts.of(wanted).predicts for wanted in ways):
        # Single events do not continue in other rows; a curve over time would interpolate them there.
        parts = parts.but_for({TIME, RUN})
    found = [_followed(settled, one, probabilities, parts) for one in every]
    classes = tuple(sorted(found, key=lambda one: (one.consequence, one.may_result)))
    doubts = _doubts_about_noise(settled) if sizes is None else ()
    sizes = detectable(settled) if sizes is None else sizes
    size = settled.channel.size if matters is None else matters
    samples = settled.noise.independent_samples(settled.channel.stretches)
    correction = False if worse and parts is None and settled.best.members else None
    if reference is not None and parts is not None and settled.best.members:
        rows = np.array([one.sum() for one in parts.rows])
        errors = np.square(parts.errors_with(corrects_of(classes)))
        correction = root(float(rows @ errors / rows.sum())) < reference
    probability, gains = probability_of_any(settled), None if parts is None else parts.of(None).gains
    doubts = (*doubts, *_doubts(settled, left, sizes, size))
    differs = DifferenceFound(
        *difference_of(probability, classes, gains, doubts, correction=correction),
        probability,
        size,
        matters is not None,
        samples,
        sizes,
        None if gains is None else gains.total,
        None if gains is None else gains.without_best,
    )
    return Levels(differs, classes, correction)


def _doubts(settled: Settled, left: LeftOver, sizes: tuple[Detectable, ...], matters: float) -> tuple[str, ...]:
    channel, found = settled.channel, list[str]()
    per, unit = (1e3, "µm") if channel.unit == "mm" and channel.rows_are == "tests" else (1.0, channel.unit)
    if settled.stopped:
        found.append("the search ended at its limit of work")
    if not left.is_noise:
        found.append(
            f"the residual is not noise: {per * left.worst.rms:.2g} {unit} in {left.worst.name}".replace("  ", " ")
        )
    for one in sizes:
        if one.size is None:
            parameters = ", ".join(channel.base.names)
            found.append(f"{one.name} could be concealed by {parameters}")
        elif one.size > matters:
            found.append(f"{one.name} is not found below {per * one.size:.2g} {unit}".rstrip())
    return tuple(found)


def _doubts_about_noise(settled: Settled) -> tuple[str, ...]:
    channel, found = settled.channel, list[str]()
    if len(channel.target) <= FEWEST_INDEPENDENT:
        found.append(f"{len(channel.target)} rows are too few to know the noise")
    if channel.time is None:
        found.append("the order of the rows is unknown, so that noise cannot be told from an effect")
    if slow_chance(settled) < SIGNIFICANT:
        found.append("slow noise could hide it")
    return tuple(found)


def slow_chance(settled: Settled) -> float:
    """Return the chance probability of so much power at the slowest frequencies, relative to the next higher ones."""
    channel = settled.channel
    if channel.time is None:
        return 1.0
    rows = settled.left[channel.kept]
    own = rows[max(channel.stretches, key=lambda one: one.stop - one.start)]
    power = np.abs(np.fft.rfft(own - own.mean())[1 : len(own) // 2]) ** 2
    low, following = power[:SLOW], power[SLOW : 3 * SLOW]
    if len(following) < 2 * SLOW:
        return 1.0
    # The base is assumed to absorb only the slowest frequencies.
    free = max(SLOW - 0.5 * channel.base.samples.shape[1], 2.0)
    return float(fdtrc(2.0 * free, 2.0 * len(following), low.sum() / free / following.mean()))


def _followed(
    settled: Settled,
    one: VariableClass,
    probabilities: VariableProbabilities,
    parts: ChosenWithoutParts | KnownGains | None,
) -> Followed:
    probability = min(probabilities.of(each) for each in one.each)
    gain = None if parts is None else parts.of(one.wanted)
    answer = _answer(probability, gain, in_time=_in_time(one))
    effect = settled.effect(sorted(one.members))[settled.channel.kept]
    variables = settled.channel.variables
    driven = {v.name for v in variables if v.driven}.union(*(law.driven for law in settled.channel.laws))
    carries = {v.name for v in variables if v.name in set[str]().union(*one.each) and may_result(v, settled.channel)}
    form, (slope, straight) = None, _straight(settled, one)
    if answer in (FollowsAnswer.FOLLOWS, FollowsAnswer.NOT_TESTED):
        rows = None if parts is None else parts.rows
        form = law_form(settled, one, rows, set() if parts is None else _refuted(settled, parts))
    return Followed(
        variables=one.each,
        or_variables=one.others,
        answer=answer,
        probability=probability,
        ways={way: way_probability(settled, one.wanted, way) for way in WAYS},
        rms=float(np.std(effect)),
        members=tuple(sorted(one.members)),
        before=None if gain is None else gain.before,
        after=None if gain is None else gain.after,
        gain=None if gain is None else gain.gains.total,
        gain_without_best=None if gain is None else gain.gains.without_best,
        parts_with_gain=None if gain is None else gain.gains.share_with_gain,
        consequence=any(driven.issuperset(each) for each in one.each),
        may_result=any(carries.issuperset(each) for each in one.each),
        form=form,
        slope=slope,
        straight=straight,
    )


def _refuted(settled: Settled, parts: ChosenWithoutParts | KnownGains) -> set[str]:
    found, picked = set[str](), settled.bank.looked_for
    for name in (cause.name for cause in settled.causes):
        gains = parts.gains_of({settled.bank.kind_of(name)})
        if gains is not None and (not gains.predicts if name in picked else gains.without_best < 0.0):
            found.add(name)
    return found


def _in_time(one: VariableClass) -> bool:
    return set[str]().union(*one.each) <= ONCE


def _straight(settled: Settled, one: VariableClass) -> tuple[Value | None, float]:
    channel = settled.channel
    variable = next((v for v in channel.variables if v.name == one.each[0][0]), None)
    if variable is None or variable.kind is Kind.TIME or variable.period is not None:
        return None, 0.0
    along = variable.values[channel.kept] - variable.values[channel.kept].mean()
    columns, values, covariance = estimated(settled, one.members)
    samples = settled.bank.samples(columns)[channel.kept]
    weights = along @ samples / (along @ along)
    slope, effect = float(weights @ values), samples @ values
    u = root(widening_of(settled.bank.tails) * float(weights @ covariance @ weights))
    whole = squares(effect - effect.mean())
    unit = f"{channel.unit}/{variable.unit}" if variable.unit else channel.unit
    return Value(slope, u, unit), slope**2 * float(along @ along) / max(whole, 1e-300)


def _answer(probability: float, gain: ClassGain | None, *, in_time: bool) -> FollowsAnswer:
    if probability < SURE:
        return FollowsAnswer.UNDECIDED
    if in_time:
        return FollowsAnswer.GOES_ON if gain is not None and gain.predicts else FollowsAnswer.HAPPENED
    if gain is None:
        return FollowsAnswer.NOT_TESTED
    return FollowsAnswer.FOLLOWS if gain.predicts else FollowsAnswer.DOES_NOT_PREDICT


def levels_by_tests(settled: Settled, left: LeftOver, gains: KnownGains | None) -> Levels:
    """Return the three answers, with the strut, or all struts, on which each class surely acts."""
    reference = None if gains is None else gains.of(None).before
    found = levels_of(settled, left, gains, reference=reference, sizes=detectable_causes(settled))
    follows = tuple(replace(one, where=_place(settled, one.members)) for one in found.follows)
    return replace(found, follows=follows)


def _place(settled: Settled, names: tuple[str, ...]) -> str | None:
    labels = {max(form_probabilities(settled, name).items(), key=lambda one: one[1]) for name in names}
    found = {label if probability >= SURE else "" for label, probability in labels}
    return (found.pop() or None) if len(found) == 1 else None


def form_probabilities(settled: Settled, name: str) -> dict[str, float]:
    """Return the probability of each form of a member, by label, given the other members."""
    cause = next(one for one in settled.causes if one.name == name)
    scan = settled.comparison.scan(settled.best.without(name), [cause])
    worth = logsumexp(scan.weighted, axis=1)
    shares = np.exp(worth - logsumexp(worth))
    found: dict[str, float] = {}
    for variant, share in zip(cause.variants, shares, strict=True):
        found[variant.label] = found.get(variant.label, 0.0) + float(share)
    return found
