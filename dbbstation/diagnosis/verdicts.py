"""Verdicts read off the probabilities of sets of causes. Nothing rewrites them afterwards."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.findings import SourceFinding, Value, Verdict
from dbbstation.diagnosis.held import uncertainties, unseen
from dbbstation.inference.alternatives import EVEN, Alternatives, norm_over_sigma, standing_out
from dbbstation.inference.concealment import concealment
from dbbstation.inference.model_comparison import SCALES
from dbbstation.inference.square_root import free_directions
from dbbstation.inference.verdict import ABSENT, OUT, SURE, Acts, claim

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.explained import Explained, SettledCircles
    from dbbstation.inference.chosen_anew import ChosenAnew
    from dbbstation.inference.model_comparison import Cause, Member, Variant
    from dbbstation.inference.verdict import Gains
    from dbbstation.sources.contract import ErrorSource

TESTABLE_SHARE = 0.5
"""Share of the combinations of a cause's amplitudes that must be seen for the cause to be ruled out."""

OPEN = "These tests leave it open: they neither show nor exclude it."


def judge(explained: Explained, anew: ChosenAnew | None = None) -> tuple[SourceFinding, ...]:
    """One finding per named cause, those that are there first.

    Args:
        explained: what the comparison came to.
        anew: what held-out tests say; None: they were not asked, and what is identified is so without them.
    """
    return _Judge(explained, anew).findings()


class _Judge:
    def __init__(self, explained: Explained, anew: ChosenAnew | None) -> None:
        self._anew = anew
        self._channel = explained.channel
        self._settled: SettledCircles = explained.settled
        self._best = explained.settled.best
        self._named = {cause.name: cause for cause in explained.settled.causes if cause.named}
        # A method of this would keep it, and all columns, alive in a ring.
        self._alternatives = Alternatives(
            self._settled.comparison,
            self._settled.causes,
            self._settled.posterior,
            self._best,
            partial(_form_uncertainty, self._channel.sources),
            self._settled.members,
        )
        self._classes, self._probability = self._alternatives.classes, self._alternatives.probability
        self._ambiguities = {
            name: self._in_words(name, *others) for name, others in self._alternatives.ambiguities.items()
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
        return tuple(sorted(found, key=lambda f: (f.verdict.rank, -f.gain)))

    def _finding(self, cause: Cause) -> SourceFinding:
        name = cause.name
        member = next((m for m in self._settled.members if m.cause.name == name), None)
        verdict, alike, equal, text = self._verdict(name)
        probability = self._probability(self._alternatives.class_with(name))
        source = self._channel.sources[name, member.variant.law if member else cause.variants[0].law]
        if member is None:
            rival = self._rivals[name]
            gain, values = rival[0], self._would_be(rival[1])
        else:
            gain, values = self._best.log_factor(name), self._fitted(name)
        signature = self._signature(name)
        if verdict is Verdict.IDENTIFIED:
            text = f"{source.texts.what} {source.texts.confirm}"
        elif verdict in {Verdict.HAPPENED, Verdict.DOES_NOT_PREDICT}:
            text = f"{source.texts.what} {text} {source.texts.confirm}"
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
            acts=self._acts(name),
            sigmas=self._sigmas_of(name),
            gains=self._gains(name),
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
            others = self._in_words(*self._alternatives.ambiguity(name))
            if others:
                return Verdict.AMBIGUOUS, others, (), _either(others)
        return self._verdict_of_absent(name)

    def _verdict_of_absent(self, name: str) -> tuple[Verdict, tuple[str, ...], tuple[str, ...], str]:
        if not self._testable(name):
            return Verdict.NOT_TESTABLE, (), (), self._why_not_testable(name)
        if self._probability((name,)) > ABSENT:
            return Verdict.NOT_TESTABLE, (), (), OPEN
        return Verdict.RULED_OUT, (), (), "It would have been seen at its plausible size and was not needed."

    def _verdict_of_member(self, name: str) -> tuple[Verdict, tuple[str, ...], tuple[str, ...], str]:
        equal = self._classes[name]
        shown = self._with_a_name(equal)
        shown = shown if len(shown) > 1 else ()
        gains, acts = self._gains(name), self._acts(name)
        worse = self._anew is not None and self._anew.is_worse
        verdict = claim(self._probability(equal), self._sigmas_of(name), acts, gains, worse=worse)
        if verdict is not Verdict.AMBIGUOUS:
            return verdict, (), shown, _why(verdict, gains)
        if name not in self._ambiguities:
            text = f"Its effect is only {self._sigmas_of(name):.2g} standard deviations out."
            return (Verdict.AMBIGUOUS, (), shown, text) if shown else (Verdict.NOT_TESTABLE, (), (), text)
        others = tuple(other for other in self._ambiguities[name] if other != name)
        if not others and not shown:
            return Verdict.NOT_TESTABLE, (), (), OPEN
        return Verdict.AMBIGUOUS, others, shown, _either(others)

    def _acts(self, name: str) -> Acts:
        return Acts.ONCE if self._channel.happens_once(name) else Acts.ALWAYS

    def _gains(self, name: str) -> Gains | None:
        """What a cause of the most probable hypothesis, or one of its class, brought in held-out tests; None: not asked."""
        if self._anew is None or name not in self._classes:
            return None
        return self._anew.gains_of([(one,) for one in self._classes[name]])

    def _sigmas_of(self, name: str) -> float:
        """By how many standard deviations the norm of an effect beside the base is out; 0 for what the hypothesis has not.

        What the formula is off by is part of the effect: how much of it belongs to the amplitude need not be known.
        """
        member = next((m for m in self._settled.members if m.cause.name == name), None)
        if member is None:
            return 0.0
        columns, comparison = member.columns, self._settled.comparison
        found = comparison.estimates([member, *self._best.without(name)])
        own = len(columns)
        return norm_over_sigma(comparison.beside((), columns), found.values[:own], found.covariance[:own, :own])

    def _with_a_name(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(name for name in names if name in self._named)

    def _in_words(self, *names: str) -> tuple[str, ...]:
        """Names of causes; of an unmodelled effect the variable that it follows."""
        follows = self._settled.unmodelled.follows
        return tuple(f"an unmodelled effect over {follows[n]}" if n in follows else n for n in names)

    def _testable(self, name: str) -> bool:
        """Whether plausible amplitudes would be seen beside base and causes; half of their combinations at least."""
        whole = max(self._named[name].variants, key=lambda v: len(v.columns))
        return self._would_be_seen(name, whole) and not self._unseen_points(name)

    def _would_be_seen(self, name: str, variant: Variant) -> bool:
        return bool(np.mean(self._sigmas(variant, self._best.without(name)) >= OUT) >= TESTABLE_SHARE)

    def _unseen_points(self, name: str) -> list[float]:
        """Values of a listed parameter, such as the run that a bump came before, at which these tests would not show a cause.

        Values of a list are cases of their own: to see one of them says nothing of another.
        """
        unseen = []
        for variant in self._named[name].variants:
            if variant.label or not variant.nonlinear:
                continue
            listed = [
                p.listed for p in self._channel.source_of(name, variant).parameters(self._channel.machine) if p.grid
            ]
            if any(listed) and not self._would_be_seen(name, variant):
                unseen.append(variant.nonlinear[listed.index(True)])
        return sorted(set(unseen))

    def _sigmas(self, variant: Variant, others: tuple[Member, ...]) -> NDArray[np.float64]:
        """By how many standard deviations combinations of plausible amplitudes stand out beside base and others, least first."""
        return standing_out(self._settled.comparison.beside(others, variant.columns), variant.plausible)

    def _why_not_testable(self, name: str) -> str:
        for member in self._settled.members:
            if self._sigmas(self._named[name].variants[0], self._best.without(member.cause.name))[-1] >= OUT:
                return f"Beside {member.cause.name}, and what its formula may be off by, these tests would not show it."
        unseen = self._unseen_points(name)
        if unseen and self._would_be_seen(name, max(self._named[name].variants, key=lambda v: len(v.columns))):
            source = self._channel.source_of(name, self._named[name].variants[0])
            listed = next(p for p in source.parameters(self._channel.machine) if p.listed)
            at = ", ".join(f"{value:g}" for value in unseen)
            return f"These tests would not show it where {listed.name} is {at}: the scatter of balls and the fitted parameters conceal it."
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
        variance = uncertainties(after, unseen(after)) ** 2 + after.layout.formula_variance(after.x)
        values: dict[str, Value] = {}
        for term in after.layout.terms:
            if term.source.name != name:
                continue
            for k, parameter in enumerate(term.parameters):
                column = term.columns.start + k
                key = parameter.name if not values.get(parameter.name) else f"{parameter.name} ({term.shared})"
                values[key] = Value(float(after.x[column]), float(np.sqrt(variance[column])), parameter.unit)
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
        amplitudes = [p for p in source.parameters(self._channel.machine) if not p.grid]
        return {
            p.name: Value(float(values[k]), float(np.sqrt(max(covariance[k, k], 0.0))), p.unit)
            for k, p in enumerate(amplitudes)
        }


def _form_uncertainty(sources: Mapping[tuple[str, str], ErrorSource], member: Member) -> float:
    """By how much the formula of a cause may be off, as a share of its effect; one without a name has none."""
    source = sources.get((member.cause.name, member.variant.law))
    return 0.0 if source is None else source.form_uncertainty


def _why(verdict: Verdict, gains: Gains | None) -> str:
    """What is said of a cause that these tests show for sure, and others do not confirm."""
    if verdict is Verdict.HAPPENED:
        return "It happened once: no other tests can confirm it."
    if verdict is not Verdict.DOES_NOT_PREDICT or gains is None:
        return ""
    text = (
        f"It was found in these tests; of {len(gains.parts)} groups of tests that were held back {gains.with_gain} gain by it, "
        f"and all but the best together {gains.without_best:.2g} in log density; {math.log(SURE / ABSENT):.2g} would be sure."
    )
    if gains.predicts:
        text += " Everything together predicts them worse than the kinematic calibration."
    return text


def _either(others: Sequence[str]) -> str:
    return f"These tests cannot tell it from {', '.join(others)}."


def _refused(name: str, why: str) -> SourceFinding:
    """Finding of a cause that cannot be what the recordings show."""
    return SourceFinding(name, Verdict.RULED_OUT, (), 0.0, 0.0, 0.0, 0.0, {}, why, probability=0.0)
