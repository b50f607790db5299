"""Verdicts read off the probabilities of sets of causes. Nothing rewrites them afterwards."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit

from dbbstation.diagnosis.channel import NAMED_ODDS
from dbbstation.diagnosis.explain import SURE
from dbbstation.diagnosis.findings import SourceFinding, Value, Verdict
from dbbstation.diagnosis.held import uncertainties
from dbbstation.inference.concealment import concealment
from dbbstation.inference.model_comparison import SCALES
from dbbstation.inference.read_off import EQUIVALENT
from dbbstation.inference.square_root import free_directions

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.explain import Explained, Settled
    from dbbstation.inference.model_comparison import Cause, Member, Variant

TESTABLE_SIGMA = 5.0
"""An amplitude of the plausible size must stand so far out of its standard deviation for a cause to be testable."""

TESTABLE_SHARE = 0.5
"""Share of the combinations of a cause's amplitudes that must be seen for the cause to be ruled out."""

EVEN = 0.5
"""Probability from which on a cause that is not certain is rather there than not."""

PRIOR = float(expit(NAMED_ODDS))
"""Probability that a cause has before anything is measured: what is more probable afterwards is not ruled out."""

MOST_ALTERNATIVES = 6
"""Causes that may stand for each other in one ambiguity, at the most; more explain nothing to anybody."""


OPEN = "These tests leave it open: they neither show nor exclude it."


def judge(explained: Explained) -> tuple[SourceFinding, ...]:
    """One finding per named cause, most probable first."""
    return _Judge(explained).findings()


class _Judge:
    def __init__(self, explained: Explained) -> None:
        self._channel = explained.channel
        self._settled: Settled = explained.settled
        self._best = explained.settled.best
        self._named = {cause.name: cause for cause in explained.settled.causes if cause.named}
        self._classes = {m.cause.name: self._class(m) for m in self._settled.members}
        self._ambiguities = {
            name: self._ambiguity(name) for name, equal in self._classes.items() if self._probability(equal) < SURE
        }
        self._rivals = {name: self._beside(c) for name, c in self._named.items() if name not in self._classes}
        self._effects = {name: self._effect(name) for name in self._named}
        # One compression of all runs serves the signatures of all causes.
        columns = [np.zeros(0, dtype=np.int64), *(columns for columns, _ in self._effects.values())]
        self._columns = np.unique(np.concatenate(columns))
        self._blocks = self._channel.blocks(self._columns, np.zeros(self._channel.runs[-1].stop))

    def findings(self) -> tuple[SourceFinding, ...]:
        """All of them."""
        found = [self._finding(cause) for cause in self._named.values()]
        found += [_refused(name, why) for name, why in self._settled.refused.items()]
        order = [Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.NOT_TESTABLE, Verdict.RULED_OUT]
        return tuple(sorted(found, key=lambda f: (order.index(f.verdict), -f.gain)))

    def _finding(self, cause: Cause) -> SourceFinding:
        name = cause.name
        member = next((m for m in self._settled.members if m.cause.name == name), None)
        verdict, alike, equal, text = self._verdict(name)
        probability = self._probability(self._class_with(name))
        source = self._channel.sources[name, member.variant.law if member else cause.variants[0].law]
        if member is None:
            rival = self._rivals[name]
            gain, values = rival[0], self._would_be(rival[1])
        else:
            gain, values = self._best.log_factor(name), self._fitted(name)
        signature = self._signature(name)
        if verdict is Verdict.IDENTIFIED:
            text = f"{source.texts.what} {source.texts.confirm}"
        elif verdict is Verdict.AMBIGUOUS:
            text = f"{text} {source.texts.confirm}"
        return SourceFinding(
            name=name,
            verdict=verdict,
            ambiguous_with=alike,
            gain=gain,
            concealed=signature[0],
            whole_um=signature[1],
            rest_um=signature[2],
            parameters=values,
            text=text,
            probability=probability,
            equivalent=equal,
        )

    def _verdict(self, name: str) -> tuple[Verdict, tuple[str, ...], tuple[str, ...], str]:
        """Verdict, with whom it is ambiguous, its class, and why."""
        if name in self._classes:
            return self._verdict_of_member(name)
        for own, equal in self._classes.items():
            if name in equal:
                text = f"It is observationally equivalent to {own}: no test of this plan tells one from the other."
                names = self._with_a_name(equal)
                return Verdict.AMBIGUOUS, tuple(n for n in names if n != name), names, text
        for ambiguity in self._ambiguities.values():
            if name in ambiguity:
                others = tuple(other for other in ambiguity if other != name)
                return Verdict.AMBIGUOUS, others, (), _either(others)
        if self._probability((name,)) >= EVEN:
            others = tuple(other for other in self._ambiguity(name) if other != name)
            if others:
                return Verdict.AMBIGUOUS, others, (), _either(others)
        return self._verdict_of_absent(name)

    def _verdict_of_absent(self, name: str) -> tuple[Verdict, tuple[str, ...], tuple[str, ...], str]:
        """The same of a cause that is rather not there."""
        if not self._testable(name):
            return Verdict.NOT_TESTABLE, (), (), self._why_not_testable(name)
        if self._probability((name,)) > PRIOR:
            return Verdict.NOT_TESTABLE, (), (), OPEN
        return Verdict.RULED_OUT, (), (), "It would have been seen at its plausible size and was not needed."

    def _verdict_of_member(self, name: str) -> tuple[Verdict, tuple[str, ...], tuple[str, ...], str]:
        """The same of a cause of the most probable hypothesis."""
        equal = self._classes[name]
        shown = self._with_a_name(equal)
        shown = shown if len(shown) > 1 else ()
        if self._probability(equal) >= SURE:
            return Verdict.IDENTIFIED, (), shown, ""
        others = tuple(other for other in self._ambiguities[name] if other != name)
        if not others and not shown:
            return Verdict.NOT_TESTABLE, (), (), OPEN
        return Verdict.AMBIGUOUS, others, shown, _either(others)

    def _class_with(self, name: str) -> tuple[str, ...]:
        """Class that a cause belongs to; itself alone where there is none."""
        return next((equal for equal in self._classes.values() if name in equal), (name,))

    def _with_a_name(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(name for name in names if name in self._named)

    def _probability(self, names: Iterable[str]) -> float:
        return self._settled.posterior.probability(names)

    def _ambiguity(self, name: str) -> tuple[str, ...]:
        """Causes of which one is there for sure, if not this one; itself alone where there are none such."""
        posterior, probable = self._settled.posterior, self._probability((name,))
        chosen = list(self._class_with(name))
        alone: dict[str, float] = {}
        for other in (cause.name for cause in self._settled.causes if cause.name not in chosen):
            both = posterior.probability_of(lambda key, pair={name, other}: pair <= key)  # type: ignore[misc]
            # What is there beside it anyway is no alternative to it.
            if both < EVEN * probable:
                alone[other] = self._probability((other,)) - both
        for other in sorted(alone, key=lambda n: -alone[n]):
            if self._probability(chosen) >= SURE or len(chosen) > MOST_ALTERNATIVES:
                break
            chosen.append(other)
        if self._probability(chosen) < SURE:
            return (name,)
        return tuple(self._in_words(one) for one in chosen)

    def _in_words(self, name: str) -> str:
        """Name of a cause; of an unmodelled effect the variable that it follows."""
        shape = self._settled.unmodelled.shapes.get(name)
        return name if shape is None else f"an unmodelled effect over {shape.follows}"

    def _class(self, member: Member) -> tuple[str, ...]:
        """Causes whose effects no test of these tells from those of a member, itself first; also those without a name."""
        others = self._best.without(member.cause.name)
        scan = self._settled.comparison.scan(
            others, [c for c in self._settled.causes if c.name not in self._best.names and not c.setup]
        )
        size = len(member.variant.columns)
        rivals = [r for r in scan.best if len(r.variant.columns) == size and self._same(member, r, others)]
        return (member.cause.name, *(rival.cause.name for rival in rivals))

    def _same(self, one: Member, other: Member, others: tuple[Member, ...]) -> bool:
        """Whether two causes of as many amplitudes span the same effects beside base and others."""
        columns = np.concatenate([one.variant.columns, other.variant.columns])
        products = self._settled.comparison.beside(others, columns)
        size = len(one.variant.columns)
        a, b, across = products[:size, :size], products[size:, size:], products[:size, size:]
        half_a, half_b = _inverse_root(a), _inverse_root(b)
        cosines = np.linalg.svd(half_a @ across @ half_b, compute_uv=False)
        return bool(cosines.min(initial=1.0) > EQUIVALENT)

    def _testable(self, name: str) -> bool:
        """Whether plausible amplitudes would be seen beside base and causes; half of their combinations at least."""
        whole = max(self._named[name].variants, key=lambda v: len(v.columns))
        return bool(np.mean(self._sigmas(whole, self._best.without(name)) >= TESTABLE_SIGMA) >= TESTABLE_SHARE)

    def _sigmas(self, variant: Variant, others: tuple[Member, ...]) -> NDArray[np.float64]:
        """By how many standard deviations combinations of plausible amplitudes stand out beside base and others, least first."""
        products = self._settled.comparison.beside(others, variant.columns)
        scaled = variant.plausible[:, None] * products * variant.plausible
        return np.sqrt(np.maximum(np.linalg.eigvalsh(scaled), 0.0))

    def _why_not_testable(self, name: str) -> str:
        for member in self._settled.members:
            if self._sigmas(self._named[name].variants[0], self._best.without(member.cause.name))[-1] >= TESTABLE_SIGMA:
                return f"Beside {member.cause.name}, and what its formula may be off by, these tests would not show it."
        return "These tests would not show it at its plausible size: the fitted parameters conceal it."

    def _beside(self, cause: Cause) -> tuple[float, Member]:
        """Log Bayes factor of a cause beside the most probable hypothesis, and the form that suits it best there."""
        scan = self._settled.comparison.scan(self._best.members, [cause])
        return float(scan.log_factor[0]), scan.best[0]

    def _effect(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Columns of a cause and its amplitudes: as found, or as plausible where it is not one of the hypothesis."""
        if name in self._rivals:
            variant = self._rivals[name][1].variant
            return variant.columns, variant.plausible
        member = next(m for m in self._settled.members if m.cause.name == name)
        columns = member.variant.columns
        found = self._settled.comparison.estimates([member, *self._best.without(name)])
        return columns, found.values[: len(columns)]

    def _signature(self, name: str) -> tuple[float, float, float]:
        """Concealed share of an effect, its root mean square, and that of what is not concealed [µm]."""
        base, (columns, amplitudes) = self._channel.base, self._effects[name]
        machine = np.flatnonzero(~base.random)
        free = free_directions(base, machine, self._channel.held)
        own = len(base.prior) + np.searchsorted(self._columns, columns)
        found = concealment(self._blocks, machine, own, amplitudes, free)
        return found.share, 1e3 * found.whole_rms, 1e3 * found.rest_rms

    def _fitted(self, name: str) -> dict[str, Value]:
        """Values of a cause in the joint fit; what its formula may be off by is part of their uncertainty."""
        after = self._settled.after
        sigma = uncertainties(after, after.solution.held)
        values: dict[str, Value] = {}
        for term in after.layout.terms:
            if term.source.name != name:
                continue
            for k, parameter in enumerate(term.parameters):
                column = term.columns.start + k
                key = parameter.name if not values.get(parameter.name) else f"{parameter.name} ({term.shared})"
                found = float(after.x[column])
                form = 0.0 if parameter.shape else term.source.form_uncertainty * abs(found)
                values[key] = Value(found, float(np.hypot(sigma[column], form)), parameter.unit)
        return values

    def _would_be(self, member: Member) -> dict[str, Value]:
        """Best amplitudes of a cause beside the others, with the uncertainty that says how much could hide."""
        source = self._channel.source_of(member.cause.name, member.variant)
        wide = replace(member, scale=float(SCALES[-1]))  # the prior must not say how much could hide
        found = self._settled.comparison.estimates([wide, *self._best.without(member.cause.name)])
        own = len(member.variant.columns)
        spread = self._channel.to_whole(member.variant)
        values = spread @ found.values[:own]
        covariance = spread @ found.covariance[:own, :own] @ spread.T
        amplitudes = [p for p in source.parameters(self._channel.machine) if not p.shape]
        return {
            p.name: Value(float(values[k]), float(np.sqrt(max(covariance[k, k], 0.0))), p.unit)
            for k, p in enumerate(amplitudes)
        }


def _either(others: Sequence[str]) -> str:
    """Text of a cause that may be there, or one of others in its place."""
    return f"These tests cannot tell it from {', '.join(others)}."


def _refused(name: str, why: str) -> SourceFinding:
    """Finding of a cause that cannot be what the recordings show."""
    return SourceFinding(name, Verdict.RULED_OUT, (), 0.0, 0.0, 0.0, 0.0, {}, why, probability=0.0)


def _inverse_root(products: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse square root of products of columns; directions that are nothing are left out."""
    value, axes = np.linalg.eigh(products)
    usable = value > RANK * max(float(value[-1]), 1e-300)
    return np.asarray((axes[:, usable] / np.sqrt(value[usable])) @ axes[:, usable].T, dtype=np.float64)


RANK = 1e-9
"""Rank tolerance: share of the largest eigenvalue below which a direction says nothing."""
