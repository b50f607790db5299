"""Findings on causes of force and on unnamed effects, and limits of a recording."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.channel import COGGING, COULOMB, MASS, METHOD_SHARE, TRANSIENT, VISCOUS, acts, source_of
from dbbstation.diagnosis.drive.findings import CausePart, DriveFinding, UnexplainedForce
from dbbstation.diagnosis.drive.pulses import complement_of, distinct_pushes, edges_of, pulse_parts
from dbbstation.facts.value import Value
from dbbstation.inference.levels import (
    MOST_PUSHES,
    OUT,
    SURE,
    FollowsAnswer,
    Gains,
    Verdict,
    ambiguous,
    open_to,
    with_texts,
)
from dbbstation.inference.patterns import Family
from dbbstation.inference.read_off import NOT_NEEDED, CauseFinding, CauseJudge, Trial
from dbbstation.inference.stretches import SHORTEST
from dbbstation.inference.triangle import norms, rms
from dbbstation.laws.friction import COULOMB_SHARE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.explain import ExplainedDrive
    from dbbstation.diagnosis.drive.findings import Complement, HeldOutForce
    from dbbstation.diagnosis.drive.pulses import Edges
    from dbbstation.inference.levels import Levels, Said
    from dbbstation.inference.model_comparison import Cause, Member
    from dbbstation.laws.contract import TableSource


class Verdicts(CauseJudge):
    """Makes findings on sources, each with the best verdict of its members.

    Args:
        held: held-out predictions; None if not tested.
    """

    is_catalogue = True

    def __init__(
        self, explained: ExplainedDrive, levels: Levels, *, several_speeds: bool, held: HeldOutForce | None = None
    ) -> None:
        self._held, self._explained, self._drive, self._several = held, explained, explained.drive, several_speeds
        super().__init__(explained.settled, Trial(), levels)
        self._raw = self.every()
        self._source_of = {f.name: source_of(self._drive, self._settled.bank.patterns, f.name) for f in self._raw}
        self._least_n = METHOD_SHARE * self._drive.scale.force_n
        self._of = {name: [f for f in self._raw if self._source_of[f.name] == name] for name in self._drive.sources}

    @cached_property
    def findings(self) -> tuple[DriveFinding, ...]:
        """Return one finding per source, best first."""
        found = [self._finding(source) for source in self._drive.sources.values()]
        return tuple(sorted(found, key=lambda f: (f.verdict.rank, -f.gain)))

    @cached_property
    def named(self) -> list[str]:
        """Return the best hypothesis's named members, ordered by force.

        Bayes factors would rank 1 N of ripple above 5 N of slow force.
        """
        squares = {f.name: f.rms**2 for f in self._raw if f.rms >= self._least_n}
        names = [name for name in self._members if self._source_of.get(name) and name in squares]
        moved = {
            source: sum(squares[name] for name in names if self._source_of[name] == source)
            for source in {self._source_of[name] for name in names}
        }
        return sorted(names, key=lambda name: (-moved[self._source_of[name]], -squares[name]))

    @property
    def predicting(self) -> list[str]:
        """Return members of `named` used for prediction, largest first.

        Of equivalent causes only one predicts. Causes that are themselves ambiguous are fitted but do not predict.
        """
        sure = {f.name for f in self.findings if f.verdict.is_there or f.ambiguous_with}
        return [name for name in self.named if self.source_of(name) in sure]

    def source_of(self, name: str) -> str:
        """Return a member's source; empty without name."""
        return self._source_of.get(name, "")

    def effects(self) -> tuple[UnexplainedForce, ...]:
        """Return present unmodelled forces, largest first."""
        sure = {
            name for one in self._levels.follows if one.answer is not FollowsAnswer.UNDECIDED for name in one.members
        }
        found = []
        for one in self._raw:
            if self._source_of[one.name] or one.name not in sure or one.sigmas < OUT:
                continue
            if one.form is Family.BLOCKS:
                which = 1.0 + float(np.argmax([*one.blocks.values()]))
                text = f"offset of {one.label}" if one.label else "offset of each recording"
                found.append(
                    UnexplainedForce(
                        text, "recording", one.probability, one.rms, which, which, "(number of the recording)"
                    )
                )
                continue
            if not one.spans:
                continue
            span = one.spans[0]
            turns = one.form in {Family.BY_DIRECTION, Family.PULSES_BY_DIRECTION}
            variable = f"{span.variable} by direction" if turns else span.variable
            found.append(UnexplainedForce(one.name, variable, one.probability, one.rms, span.low, span.high, span.unit))
        return tuple(sorted(found, key=lambda e: -e.rms_n))

    def _sigmas(self, member: Member, values: Floats, covariance: Floats) -> float:
        name, after = member.name, self._explained.after
        sigmas = super()._sigmas(member, values, covariance)
        if name not in self._members or name not in self._drive.of_law:
            return sigmas
        own = after.columns_of(name)
        found = after.values[own]
        return min(sigmas, float(np.sqrt(found @ np.linalg.solve(after.covariance[own, own], found))))

    def _verdict(self, cause: Cause, member: Member | None, probability: float, sigmas: float) -> Said:
        """Return the verdict; stretches whose edges follow the motion may equally be errors of a law."""
        verdict, others, text = super()._verdict(cause, member, probability, sigmas)
        if verdict is Verdict.AMBIGUOUS and not others:
            others = self._alternatives.ambiguity(cause.name)
        pattern = self._settled.bank.patterns.get(cause.name)
        if verdict is not Verdict.HAPPENED or pattern is None or pattern.family is not Family.PULSES:
            return verdict, others, text
        shortest = SHORTEST * self._drive.recordings.samples_apart_s
        if all(part.parameters["duration_s"].value < shortest for part in self._pulses):
            why = f"None of its stretches stands out for {SHORTEST} samples of the band, {shortest:.2g} s, or more."
            return Verdict.AMBIGUOUS, (), why
        edges = self._edges
        if probability * edges.pushed >= SURE:
            return verdict, others, text
        why = (
            f"{edges.at_turns} of {edges.count} beginnings and ends are where the drive starts, stops or reverses, which it does "
            f"in {100.0 * edges.share:.0f} % of the time: friction or inertia that no law describes there is as likely."
        )
        return Verdict.AMBIGUOUS, (), why

    def _pushes(self) -> dict[str, Sequence[Value]]:
        """Return sizes of pushes by member; stretches of all members are combined and counted for the first member."""
        patterns = self._settled.bank.patterns
        found = {name: own for name, own in super()._pushes().items() if patterns[name].family is Family.PULSES}
        if not self._pulses:
            return found
        return dict.fromkeys(found, ()) | {next(iter(found)): [part.parameters["force_n"] for part in self._pulses]}

    def _finding(self, source: TableSource) -> DriveFinding:
        own = self._of[source.name]
        there = [f for f in own if f.verdict.may_be_there and f.name in self.named]
        none = CauseFinding(name="", verdict=Verdict.RULED_OUT)
        best = max(there or own, key=lambda f: f.log_bayes_factor, default=none)
        verdict, alike, text = self._said(source, own, there)
        ends = self._at_end(there)
        beyond = (f"{name} is at the end of what is tried, {span}: it may lie beyond." for name, span in ends.items())
        pulses = [f for f in there if f.form is Family.PULSES]
        parts = tuple(part for f in there if f not in pulses for part in self._parts(f))
        told = bool(pulses) and distinct_pushes(self._pulses) <= MOST_PUSHES
        complement = self._complement if told else None
        text = " ".join([text, *beyond, *([] if complement is None else [_in_words(complement)])])
        parameters = self._values_found(best)
        if len(there) > 1 and best.form is None:
            parameters = {k: v for f in reversed(there) for k, v in self._values_found(f).items()}
        gains = None if self._held is None else self._held.gains.get(source.name, Gains(()))
        return DriveFinding(
            name=source.name,
            verdict=verdict,
            probability=self._probability(own) * (self._edges.pushed if pulses else 1.0),
            ambiguous_with=alike,
            gain=best.log_bayes_factor,
            concealed=best.confounded,
            signature_rms_n=best.whole_rms,
            unconcealed_rms_n=best.rms,
            parameters=parameters,
            parts=(*parts, *(self._pulses if told else ())),
            text=text,
            at_end=tuple(ends),
            complement=complement,
            acts=acts(source.name),
            persists=verdict is Verdict.HAPPENED and gains is not None and gains.predicts,
            gains=gains,
        )

    def _said(self, source: TableSource, own: Sequence[CauseFinding], there: Sequence[CauseFinding]) -> Said:
        alike = self._others(source, there or own)
        if there and source.name == COULOMB and not self._several:
            alike = (*alike, "viscous friction")
        first = min(there, key=lambda f: f.verdict.rank, default=None)
        if first is None:
            # An equivalent unmodelled force is no evidence for a cause.
            alike = tuple(name for name in alike if name in self._drive.sources)
        if alike:
            verdict, alike, why = ambiguous(self._rows, alike, "")
        elif first is None:
            verdict, why = self._not_there(source, own)
        else:
            verdict, why = first.verdict, first.text
        return verdict, alike, with_texts(verdict, why, source.texts)

    def _at_end(self, there: Sequence[CauseFinding]) -> dict[str, str]:
        laws = [f.name for f in there if f.name in self._drive.of_law]
        ends = [(name, span) for law in laws for name, span in self._explained.after.at_end(law).items()]
        return {name: f"{low:.3g} to {high:.3g}" for name, (low, high) in ends}

    @cached_property
    def _pulses(self) -> tuple[CausePart, ...]:
        patterns = self._settled.bank.patterns
        names = [name for name in self._members if name in patterns and patterns[name].family is Family.PULSES]
        return tuple(pulse_parts(self._explained, names)) if names else ()

    @cached_property
    def _edges(self) -> Edges:
        return edges_of(self._drive.recordings, self._pulses)

    @cached_property
    def _complement(self) -> Complement | None:
        time = self._drive.recordings.time_s
        return complement_of(self._pulses, float(time[0]), float(time[-1]))

    def _probability(self, own: Sequence[CauseFinding]) -> float:
        return max([self._settled.probability([f.name for f in own]), *(f.probability for f in own)])

    def _others(self, source: TableSource, findings: Sequence[CauseFinding]) -> tuple[str, ...]:
        names, impossible = set(), {f.name for f in self._raw if f.verdict is Verdict.RULED_OUT}
        for finding in findings:
            for other in {*finding.equivalent, *finding.ambiguous_with} - {finding.name, *impossible}:
                theirs = self._source_of.get(other, "")
                if theirs != source.name:
                    names.add(theirs or f"a force that follows {other.split(' over ')[-1].split(',')[0]}")
        return tuple(sorted(names))

    def _not_there(self, source: TableSource, own: Sequence[CauseFinding]) -> tuple[Verdict, str]:
        looked_for = {COGGING: lambda: self._no_cogging(own), TRANSIENT: self._no_transient}
        if why := self._hidden(source, own):
            return Verdict.NOT_TESTABLE, why
        if source.name in looked_for:
            return looked_for[source.name]()
        for finding in own:
            # A cause that cannot be distinguished, even from an unmodelled force, could not be detected.
            if finding.verdict in {Verdict.NOT_TESTABLE, Verdict.AMBIGUOUS}:
                return Verdict.NOT_TESTABLE, finding.text
        refused = next((f.text for f in own if f.name in self._settled.refused), "")
        if not refused and own and self._probability(own) > source.prior_probability:
            verdict, _, why = open_to(self._rows)
            return verdict, why
        return Verdict.RULED_OUT, refused or NOT_NEEDED

    def _hidden(self, source: TableSource, own: Sequence[CauseFinding]) -> str:
        scale = self._drive.scale
        if faint := [f for f in own if f.name in self._members]:
            return f"What it would explain, {faint[0].rms:.2g} N rms, is less than filters and differences leave of a perfect drive."
        if source.name == COULOMB and not self._several:
            return "One speed tells the sum of Coulomb and viscous friction, and no more."
        if not own and source.name not in {COGGING, TRANSIENT} and not scale.both_ways and not source.forms(scale):
            share = self._drive.recordings.least_way
            if share == 0.0:
                return "The drive never reverses here, and only a reversal would show it."
            return (
                f"Only {100.0 * share:.2g} % of the samples are travelled in the other direction, too few to show it."
            )
        return ""

    def _no_cogging(self, own: Sequence[CauseFinding]) -> tuple[Verdict, str]:
        scale, shortest = self._drive.scale, self._drive.shortest_wave_mm
        if not np.isfinite(shortest):
            return Verdict.NOT_TESTABLE, f"Within {scale.cutoff_hz:.3g} Hz no wave fits three times into the travel."
        recordings = self._drive.recordings
        hidden = rms(recordings.at(lambda s: s.force_n) - recordings.force_n)
        if hidden >= 0.1 * scale.force_n / np.sqrt(2.0):
            return Verdict.NOT_TESTABLE, (
                f"Waves down to {shortest:.3g} mm are looked for ({scale.cutoff_hz:.3g} Hz at the usual speed, the band of the "
                f"comparison), and none is there. Above {scale.cutoff_hz:.3g} Hz the force moves by {hidden:.2g} N rms, which "
                "may be shorter ones: travel more slowly, or sample faster and give a higher --cutoff-hz."
            )
        if any(f.verdict is Verdict.NOT_TESTABLE for f in own):
            return Verdict.NOT_TESTABLE, next(f.text for f in own if f.verdict is Verdict.NOT_TESTABLE)
        return Verdict.RULED_OUT, (
            f"Waves down to {shortest:.3g} mm ({scale.cutoff_hz:.3g} Hz at the usual speed) would have been seen, and above that "
            f"the force moves by {hidden:.2g} N rms only."
        )

    def _no_transient(self) -> tuple[Verdict, str]:
        settled, scale = self._settled, self._drive.scale
        apart = self._drive.recordings.samples_apart_s
        size = 0.3 * scale.force_n
        rows = max(3, int(np.ceil((OUT * settled.noise.effective / size) ** 2)))
        if rows > len(self._drive.channel.residual) // 8:
            return (
                Verdict.NOT_TESTABLE,
                "The noise would hide a force of a plausible size that lasts an eighth of the recording.",
            )
        return (
            Verdict.RULED_OUT,
            f"A force of {size:.2g} N for {rows * apart:.2g} s would have been seen; a shorter one is not in the band.",
        )

    def _values_found(self, finding: CauseFinding) -> dict[str, Value]:
        if finding.name in self._drive.of_law and finding.name in self._members:
            return self._explained.after.parameters(finding.name)
        return finding.values if finding.form is None else {}

    def _parts(self, finding: CauseFinding) -> list[CausePart]:
        if finding.name in self._drive.of_law:
            return [CausePart(self._drive.of_law[finding.name][1].label, None, self._values_found(finding))]
        return [CausePart(finding.name, None, dict(finding.values))]


def _in_words(complement: Complement) -> str:
    size = complement.force_n
    return (
        f"{complement.pulses} of them are of one size: {replace(size, value=-size.value).in_words} in these, or {size.value:+.3g} N in the "
        "stretches between them and a constant load beside it: no recording says which."
    )


ACCELERATES = 5.0
"""Least ratio of the acceleration's rms to its noise that determines the mass."""

VAGUE = 0.3
"""Relative standard uncertainty above which a value counts as unknown."""


@dataclass(frozen=True)
class DriveLimits:
    """Parameters that cannot be distinguished."""

    accelerates: bool
    several_speeds: bool
    reverses: bool


def limits_of(explained: ExplainedDrive) -> DriveLimits:
    """Return the limits of the motion.

    Coulomb friction must be significant given mass, viscous friction and a delay, which ramps cannot separate.
    """
    recordings, bank = explained.drive.recordings, explained.settled.bank
    acceleration = recordings.motion[:, 0]
    sign = recordings.compared(lambda s: s.direction)
    late = recordings.compared(lambda s: np.gradient(s.force_n, 1.0 / s.rate_hz))
    columns = bank.whitened(np.column_stack([recordings.motion, late, sign]))
    columns = columns / norms(columns) * np.linalg.norm(columns[:, -1])
    beside, *_ = np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=None)
    rest = float(np.linalg.norm(columns[:, -1] - columns[:, :-1] @ beside))
    seen = COULOMB_SHARE * recordings.scale.force_n * rest / explained.settled.noise.innovation
    noise = float(np.sqrt(np.mean([one.acceleration_noise_m_s2**2 for one in recordings.signals])))
    return DriveLimits(
        accelerates=rms(acceleration) > ACCELERATES * noise,
        several_speeds=bool(seen >= OUT),
        reverses=recordings.scale.both_ways,
    )


def mass_is_known(limits: DriveLimits, mass: Value | None) -> bool:
    """Return whether mass is determined."""
    return mass is not None and limits.accelerates and mass.uncertainty < VAGUE * mass.value


def sentences(limits: DriveLimits, explained: ExplainedDrive, known: dict[str, bool]) -> tuple[str, ...]:
    """Return sentences on undetermined numbers and further recordings."""
    sentences = list(explained.dropped.values())
    if not known[MASS] and MASS not in explained.dropped:
        sentences.append(
            "The mass cannot be determined: the drive hardly accelerates here, or the force does not answer to it. Record "
            "starts, stops and reversals."
        )
    if not limits.several_speeds:
        before = explained.before
        speed = float(np.median(np.abs(explained.drive.recordings.motion[:, 1])))
        force = before.base[VISCOUS]
        sentences.append(
            "Viscous and Coulomb friction cannot be distinguished at one speed. What is known is their sum at "
            f"{1e3 * speed:.4g} mm/s, {Value(force.value * speed, force.uncertainty * speed, 'N').in_words}. Record at several speeds."
        )
    elif not known[VISCOUS] and VISCOUS not in explained.dropped:
        sentences.append(
            "The viscous friction cannot be determined well here: what friction does at these speeds has several explanations, or it is "
            "small. Record at more speeds, and faster ones."
        )
    if not limits.reverses:
        recordings = explained.drive.recordings
        share = f"only {100.0 * recordings.least_way:.2g} % of the samples are travelled in the other direction"
        why = share if recordings.least_way > 0.0 else "the drive never reverses"
        sentences.append(
            "Coulomb friction and a constant load cannot be distinguished, nor friction of the two directions: "
            f"{why}. What is known is their sum in this direction. Record to and fro."
        )
    return tuple(sentences)
