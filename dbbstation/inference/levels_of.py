"""Derive the three answers from a comparison and held-out parts.

A column may be a consequence of the difference instead of its cause.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import fdtrc, logsumexp

from dbbstation.facts.value import Value
from dbbstation.inference.coloured import FEWEST_INDEPENDENT
from dbbstation.inference.detectable import ENTIRELY, detectable, detectable_causes
from dbbstation.inference.followed import (
    VariableProbabilities,
    classes_of,
    estimated,
    probability_of_any,
    way_probability,
)
from dbbstation.inference.law_form import law_form
from dbbstation.inference.left_over import SIGNIFICANT
from dbbstation.inference.levels import ONCE, RUN, TIME, Followed, FollowsAnswer, Levels, corrects_of, difference_of
from dbbstation.inference.triangle import left_by, root, squares
from dbbstation.inference.uneven import widening_of
from dbbstation.inference.variables import Kind
from dbbstation.inference.verdict import SURE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.inference.channel import Channel
    from dbbstation.inference.chosen_anew import ChosenAnew, KnownGains
    from dbbstation.inference.folds import HeldOutError
    from dbbstation.inference.followed import ChosenWithoutParts, ClassGain, VariableClass
    from dbbstation.inference.left_over import LeftOver
    from dbbstation.inference.levels import Detectable
    from dbbstation.inference.settled import Settled
    from dbbstation.inference.variables import Variable


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
    if not ENTIRELY * whole < left <= (1.0 - DETERMINED) * whole or both > (1.0 - CARRIES) * left:
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
    held_out: HeldOutError | ChosenAnew | None,
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
    found = [_followed(settled, one, probabilities, parts, held_out) for one in every]
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
    differs = difference_of(
        probability_of_any(settled),
        classes,
        None if parts is None else parts.of(None).gains,
        (*doubts, *_doubts(settled, left, sizes, size)),
        (size, matters is not None, samples, sizes),
        correction=correction,
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
    held_out: HeldOutError | ChosenAnew | None,
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
        form = law_form(settled, one, rows, set() if held_out is None else _refuted(settled, held_out))
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


def _refuted(settled: Settled, held_out: HeldOutError | ChosenAnew) -> set[str]:
    found, picked = set[str](), settled.bank.looked_for
    for name in (cause.name for cause in settled.causes):
        gains = held_out.gains_of({settled.bank.kind_of(name)})
        if not gains.predicts if name in picked else gains.without_best < 0.0:
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
    anew, reference = (None, None) if gains is None else (gains.anew, gains.of(None).before)
    found = levels_of(settled, left, gains, anew, reference=reference, sizes=detectable_causes(settled))
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
