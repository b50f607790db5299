"""Verdicts on causes of force, and unnamed effects."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.channel import METHOD_SHARE
from dbbstation.diagnosis.drive.findings import CausePart, DriveFinding, UnexplainedForce
from dbbstation.diagnosis.drive.naming import COGGING, COULOMB, TRANSIENT, acts, source_of
from dbbstation.diagnosis.drive.noise_rival import probability_beside_noise
from dbbstation.diagnosis.drive.pulses import complement_of, distinct_pushes, edges_of, pulse_parts
from dbbstation.inference.levels import FollowsAnswer
from dbbstation.inference.patterns import Family
from dbbstation.inference.pushes import MOST_PUSHES
from dbbstation.inference.read_off import read_off
from dbbstation.inference.stretches import SHORTEST
from dbbstation.inference.verdict import OUT, SURE, Acts, Gains, Verdict

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.diagnosis.drive.contract import DriveSource
    from dbbstation.diagnosis.drive.explain import ExplainedDrive
    from dbbstation.diagnosis.drive.findings import Complement, HeldOutForce
    from dbbstation.facts.value import Value
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.read_off import CauseFinding

CLAIMS = frozenset({Verdict.IDENTIFIED, Verdict.AMBIGUOUS})
PREDICTS = frozenset({Verdict.IDENTIFIED, Verdict.HAPPENED})


class Verdicts:
    """All verdicts on causes, named and unnamed.

    Args:
        held: held-out predictions; None: not tested.
    """

    def __init__(
        self, explained: ExplainedDrive, levels: Levels, *, several_speeds: bool, held: HeldOutForce | None = None
    ) -> None:
        self._held, self._levels = held, levels
        self._explained, self._drive, self._several = explained, explained.drive, several_speeds
        self._raw = read_off(explained.settled)
        self._source_of = {f.name: self._source(f) for f in self._raw}
        self._least_n = METHOD_SHARE * self._drive.scale.force_n
        self._of = {name: [f for f in self._raw if self._source_of[f.name] == name] for name in self._drive.sources}

    def findings(self) -> tuple[DriveFinding, ...]:
        """Return a finding per source, best first."""
        found = [self._finding(source) for source in self._drive.sources.values()]
        return tuple(sorted(found, key=lambda f: (f.verdict.rank, -f.gain)))

    @property
    def named(self) -> list[str]:
        """Return the best hypothesis's named members by force.

        Bayes factors would rank a newton of ripple above five newtons of slow force.
        """
        best = self._explained.settled.best
        faint = {f.name for f in self._raw if f.rms < self._least_n}
        names = [m.cause.name for m in best.members if self._source_of.get(m.cause.name) and m.cause.name not in faint]
        squares = {f.name: f.rms**2 for f in self._raw}
        moved = {
            source: sum(squares[name] for name in names if self._source_of[name] == source)
            for source in {self._source_of[name] for name in names}
        }
        return sorted(names, key=lambda name: (-moved[self._source_of[name]], -squares[name]))

    @property
    def predicting(self) -> list[str]:
        """Return members of `named` for prediction, largest first.

        One of several equivalent causes predicts; causes ambiguous by themselves are fitted but do not predict.
        """
        sure = {f.name for f in self.findings() if f.verdict in PREDICTS or f.ambiguous_with}
        return [name for name in self.named if self.source_of(name) in sure]

    def source_of(self, name: str) -> str:
        """Return a member's source; empty without name."""
        return self._source_of.get(name, "")

    def effects(self) -> tuple[UnexplainedForce, ...]:
        """Return present unmodelled forces, largest first."""
        found = []
        for one in self._raw:
            if self._source_of[one.name] or one.verdict is not Verdict.IDENTIFIED:
                continue
            if one.family is Family.BLOCKS:
                which = 1.0 + float(np.argmax(one.blocks))
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
            turns = one.family in {Family.BY_DIRECTION, Family.PULSES_BY_DIRECTION}
            variable = f"{span.variable} by direction" if turns else span.variable
            found.append(UnexplainedForce(one.name, variable, one.probability, one.rms, span.low, span.high, span.unit))
        return tuple(sorted(found, key=lambda e: -e.rms_n))

    def _source(self, finding: CauseFinding) -> str:
        return source_of(self._drive, self._explained.settled.bank.patterns, finding.name)

    def _finding(self, source: DriveSource) -> DriveFinding:
        own = self._of[source.name]
        there = [self._as_sure_as_it_is(f) for f in own if f.verdict in CLAIMS and f.name in self.named]
        alike = self._alike(source, there or own)
        if there and source.name == COULOMB and not self._several:
            alike = (*alike, "viscous friction")
        if there:
            sure = not alike and any(f.verdict is Verdict.IDENTIFIED for f in there)
            verdict = self._claimed(source.name, there) if sure else Verdict.AMBIGUOUS
            text = self._text(source, verdict, alike, there)
        else:
            verdict, text = self._absent(source, own)
            # An unmodelled force that could stand for it is no reason to expect it.
            alike = tuple(name for name in alike if name in self._drive.sources)
            if alike:
                verdict, text = (
                    Verdict.AMBIGUOUS,
                    f"This recording cannot tell it from {', '.join(alike)}. {source.texts.confirm}",
                )
        best = max(there or own, key=lambda f: f.log_factor, default=None)
        ends = self._at_end(there)
        text = " ".join(
            [
                text,
                *(f"{name} is at the end of what is tried, {span}: it may lie beyond." for name, span in ends.items()),
            ]
        )
        pulses = [f for f in there if f.family is Family.PULSES]
        pushed = max((f.probability for f in pulses), default=0.0)
        parts = tuple(part for f in there if f not in pulses for part in self._parts(f))
        complement = self._complement if pulses and distinct_pushes(self._pulses) <= MOST_PUSHES else None
        parts += self._pulses if pulses and distinct_pushes(self._pulses) <= MOST_PUSHES else ()
        parameters = self._values(best) if best is not None else {}
        if len(there) > 1 and best is not None and best.family is None:
            parameters = {k: v for f in reversed(there) for k, v in self._values(f).items()}
        gains = None if self._held is None else self._held.gains.get(source.name, Gains(()))
        return DriveFinding(
            name=source.name,
            verdict=verdict,
            probability=pushed if pulses else self._probability([f.name for f in own], own),
            ambiguous_with=alike,
            gain=best.log_factor if best is not None else 0.0,
            concealed=best.confounded if best is not None else 0.0,
            signature_rms_n=best.whole_rms if best is not None else 0.0,
            unconcealed_rms_n=best.rms if best is not None else 0.0,
            parameters=parameters,
            parts=parts,
            text=text if complement is None else f"{text} {_in_words(complement)}",
            at_end=tuple(ends),
            complement=complement,
            acts=acts(source.name),
            persists=verdict is Verdict.HAPPENED and gains is not None and gains.predicts,
            gains=gains,
        )

    def _claimed(self, source: str, there: Sequence[CauseFinding]) -> Verdict:
        if acts(source) is Acts.ONCE:
            return Verdict.HAPPENED
        names = {finding.name for finding in there}
        answers = [one.answer for one in self._levels.follows if names.intersection(one.members)]
        refuted = bool(answers) and all(one is FollowsAnswer.DOES_NOT_PREDICT for one in answers)
        return Verdict.DOES_NOT_PREDICT if refuted else Verdict.IDENTIFIED

    def _at_end(self, there: Sequence[CauseFinding]) -> dict[str, str]:
        laws = [f.name for f in there if f.name in self._drive.of_law and self._is_member(f)]
        ends = [(name, span) for law in laws for name, span in self._explained.after.at_end(law).items()]
        return {name: f"{low:.3g} to {high:.3g}" for name, (low, high) in ends}

    def _as_sure_as_it_is(self, finding: CauseFinding) -> CauseFinding:
        """Return a finding with uncertainties widened until stretches and bands agree."""
        if finding.verdict is Verdict.IDENTIFIED and finding.family is Family.PULSES:
            return self._as_sure_as_its_edges(finding)
        if finding.verdict is not Verdict.IDENTIFIED or finding.name not in self._drive.of_law:
            return finding
        after = self._explained.after
        own = after.columns_of(finding.name)
        values, covariance = after.values[own], after.covariance[own, own]
        sigmas = float(np.sqrt(values @ np.linalg.solve(covariance, values)))
        if sigmas >= OUT:
            return finding
        why = (
            f"Its size differs between parts of the recording, or between bands, so that it is only {sigmas:.2g} standard "
            "uncertainties out: something that is not in the model changes it, or stands behind it."
        )
        return replace(finding, verdict=Verdict.AMBIGUOUS, text=why)

    def _as_sure_as_its_edges(self, finding: CauseFinding) -> CauseFinding:
        """Return stretches if they are few, not noise, and independent of motion."""
        if not self._pulses:
            why = "None of its stretches stands out of those beside it."
            return replace(finding, verdict=Verdict.AMBIGUOUS, text=why)
        shortest = SHORTEST * self._drive.recordings.samples_apart_s
        if all(part.parameters["duration_s"].value < shortest for part in self._pulses):
            why = f"It is shorter than {SHORTEST} samples of the band, {shortest:.2g} s: one sample that is off looks the same."
            return replace(finding, verdict=Verdict.AMBIGUOUS, text=why)
        sizes = distinct_pushes(self._pulses)
        if sizes > MOST_PUSHES:
            why = (
                f"{len(self._pulses)} stretches of time would be needed, {sizes} of them of sizes of their own: a law that is wrong is more "
                "likely than so many pushes, and none of them is told."
            )
            return replace(finding, verdict=Verdict.AMBIGUOUS, text=why)
        edges = edges_of(self._drive.recordings, self._pulses)
        probability = finding.probability * edges.pushed
        if probability >= SURE:
            probability *= self._beside_noise
            if probability >= SURE:
                return replace(finding, probability=probability)
            why = "Noise whose neighbours resemble each other explains it as well."
            return replace(finding, verdict=Verdict.AMBIGUOUS, probability=probability, text=why)
        why = (
            f"{edges.at_turns} of {edges.count} beginnings and ends are where the drive starts, stops or reverses, which it does "
            f"in {100.0 * edges.share:.0f} % of the time: friction or inertia that no law describes there is as likely."
        )
        return replace(finding, verdict=Verdict.AMBIGUOUS, probability=probability, text=why)

    @cached_property
    def _beside_noise(self) -> float:
        return probability_beside_noise(self._explained.settled)

    @cached_property
    def _pulses(self) -> tuple[CausePart, ...]:
        names = [
            f.name for f in self._raw if f.family is Family.PULSES and f.verdict in CLAIMS and f.name in self.named
        ]
        return tuple(pulse_parts(self._explained, names)) if names else ()

    @cached_property
    def _complement(self) -> Complement | None:
        time = self._drive.recordings.time_s
        return complement_of(self._pulses, float(time[0]), float(time[-1]))

    def _is_member(self, finding: CauseFinding) -> bool:
        return finding.name in self._explained.settled.best.names

    def _probability(self, names: Sequence[str], own: Sequence[CauseFinding]) -> float:
        alone = self._explained.settled.posterior.probability(names) if names else 0.0
        return max([alone, *(f.probability for f in own)]) if own else alone

    def _alike(self, source: DriveSource, findings: Sequence[CauseFinding]) -> tuple[str, ...]:
        names = set()
        for finding in findings:
            for other in {*finding.equivalent, *finding.ambiguous_with} - {finding.name}:
                theirs = self._source_of.get(other, "")
                if theirs != source.name and self._could_be(finding.name, other):
                    names.add(theirs or f"a force that follows {other.split(' over ')[-1].split(',')[0]}")
        return tuple(sorted(names))

    def _could_be(self, one: str, other: str) -> bool:
        laws = self._drive.of_law
        inside, outside = (one, other) if one in self._explained.settled.best.names else (other, one)
        if outside not in laws or inside not in laws or inside not in self._explained.settled.best.names:
            return True
        after = self._explained.after
        amplitude = float(after.values[after.columns_of(inside).start])
        source, form = laws[outside]
        parameter = form.amplitudes[0]
        size = amplitude if not parameter.positive else abs(amplitude)
        return source.possible(after.all_values() | {parameter.name: size}, self._drive.scale)

    def _text(self, source: DriveSource, verdict: Verdict, alike: Sequence[str], there: Sequence[CauseFinding]) -> str:
        if verdict is Verdict.IDENTIFIED:
            return f"{source.texts.what} {source.texts.confirm}"
        if verdict is Verdict.HAPPENED:
            return f"{source.texts.what} It happened here; no other samples can test it. {source.texts.confirm}"
        if verdict is Verdict.DOES_NOT_PREDICT:
            return f"It is there in these samples, and held-out parts gain nothing by it. {source.texts.confirm}"
        if alike:
            return f"This recording cannot tell it from {', '.join(alike)}. {source.texts.confirm}"
        return f"{there[0].text or 'This recording does not decide it.'} {source.texts.confirm}"

    def _absent(self, source: DriveSource, own: Sequence[CauseFinding]) -> tuple[Verdict, str]:
        looked_for = {COGGING: lambda: self._no_cogging(own), TRANSIENT: self._no_transient}
        if why := self._hidden(source, own):
            return Verdict.NOT_TESTABLE, why
        if source.name in looked_for:
            return looked_for[source.name]()
        for finding in own:
            # What nothing tells from something else, were it only an unmodelled force, would not have been seen.
            if finding.verdict in {Verdict.NOT_TESTABLE, Verdict.AMBIGUOUS}:
                return Verdict.NOT_TESTABLE, finding.text
        refused = [f.text for f in own if f.text and f.probability == 0.0 and not f.values]
        refused += [why for name, why in self._explained.refused.items() if name.split(" ")[0] == source.name]
        if not refused and own and self._probability([f.name for f in own], own) > source.prior_probability:
            return Verdict.NOT_TESTABLE, "This recording leaves it open: it neither shows nor excludes it."
        not_needed = "It would have been seen at its plausible size and was not needed."
        return Verdict.RULED_OUT, refused[0] if refused else not_needed

    def _hidden(self, source: DriveSource, own: Sequence[CauseFinding]) -> str:
        scale = self._drive.scale
        if faint := [f for f in own if self._is_member(f)]:
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
        hidden = self._beyond_band_n()
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

    def _beyond_band_n(self) -> float:
        """Return the rms force beyond the band [N]."""
        recordings = self._drive.recordings
        return float(np.sqrt(np.mean((recordings.at(lambda s: s.force_n) - recordings.force_n) ** 2)))

    def _no_transient(self) -> tuple[Verdict, str]:
        """Return that no stretch stands out, with the shortest visible."""
        settled, scale = self._explained.settled, self._drive.scale
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

    def _values(self, finding: CauseFinding) -> dict[str, Value]:
        if finding.name in self._drive.of_law and self._is_member(finding):
            return self._explained.after.parameters(finding.name)
        return finding.values if finding.family is None else {}

    def _parts(self, finding: CauseFinding) -> list[CausePart]:
        if finding.name in self._drive.of_law:
            return [CausePart(self._drive.of_law[finding.name][1].label, None, self._values(finding))]
        return [CausePart(finding.name, None, dict(finding.values))]


def _in_words(complement: Complement) -> str:
    size = complement.force_n
    return (
        f"{complement.pulses} of them are of one size: {-size.value:+.3g} ± {size.uncertainty:.2g} N in these, or {size.value:+.3g} N in the "
        "stretches between them and a constant load beside it: no recording says which."
    )
