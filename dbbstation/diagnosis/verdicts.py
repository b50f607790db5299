"""Verdicts on sources."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.outlier import SOURCE_OF
from dbbstation.diagnosis.findings import SourceFinding, Unexplained, Value, Verdict
from dbbstation.diagnosis.held import uncertainties
from dbbstation.diagnosis.shapes import variable_of
from dbbstation.inference.concealment import concealment
from dbbstation.inference.race import AS_GOOD, Race, as_good, contained, worth_of
from dbbstation.inference.square_root import free_directions

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.fit import Calibration
    from dbbstation.calibration.outlier import Outlier
    from dbbstation.diagnosis.channel import Channel
    from dbbstation.inference.race import Choice, Variant
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import ErrorSource

TESTABLE_SIGMA = 5.0
"""An amplitude of the plausible size must stand so far out of its standard deviation for a source to be testable."""

TESTABLE_SHARE = 0.5
"""Share of the combinations of a source's amplitudes that must be seen for the source to be ruled out."""

FEW = 8
"""Amplitudes of a source, as those of one strut, up to which explaining the same makes it as likely as another."""

OWN_LAW = 0.02
"""Share of its log evidence by which one source that grows with time must be better than another."""

MAKES_UP = 0.2
"""Share of another's evidence below which a source that grows with time may only make up for its law: a warm-up in two stages
calls for a second source with a seventh of what the first brings."""

ROUGHLY = 0.025
"""Share of the evidence of a source of a rough law below which any other may only make up for it: beside single causes, ten times
as large as what is just seen, up to 0.022."""

CROWD = 3
"""Causes at once that are more than happens."""

OUTWEIGHS = 10.0
"""By how much a first cause must outweigh what all others bring, to stand beside them."""


def testable(race: Race, variant: Variant, others: Sequence[Variant]) -> bool:
    """Whether plausible amplitudes of a source would be seen beside the base and others.

    A source with many amplitudes may be seen along some of their combinations only: half of them have to be.
    """
    seen = race.visible(variant, others) >= TESTABLE_SIGMA
    return bool(np.mean(seen) >= TESTABLE_SHARE)


def judge(
    channel: Channel,
    race: Race,
    joint: Channel,
    noise_mm: float,
    chosen: Sequence[Choice],
    sources: dict[str, ErrorSource],
    after: Calibration,
) -> tuple[SourceFinding, ...]:
    """One finding per named source, best first.

    Args:
        channel: about the base fit.
        race: of that channel, with the noise that is left in the end.
        joint: the channel about the joint fit; what was not chosen is judged there, beside exact values of what was.
        noise_mm: of one sample, in the end [mm].
        chosen: sources that were found.
        sources: by name.
        after: joint fit.
    """
    # The joint fit keeps the base's columns where they were and adds those of the chosen behind.
    machine_columns = np.flatnonzero(~channel.base.random)
    free = free_directions(channel.base, machine_columns, channel.held)
    names = [choice.candidate.name for choice in chosen]
    likes = _likenesses(race, chosen, channel, sources)
    rest = joint.race(noise_mm)
    on_joint = {candidate.name: candidate for candidate in joint.named}
    findings = []
    for candidate in channel.named:
        source = sources[candidate.name]
        alike = likes.get(candidate.name, ())
        if candidate.name in names:
            others = [c.variant for c in chosen if c.candidate.name != candidate.name]
            _, together = race.best_variant(candidate, others)
            gain = together - race.evidence(others)
            signature = concealment([joint.joined], machine_columns, *_fitted_amplitudes(after, candidate.name), free)
            values = _fitted_values(after, candidate.name)
            verdict = Verdict.AMBIGUOUS if alike else Verdict.IDENTIFIED
        else:
            beside = on_joint[candidate.name]
            variant, gain = rest.best_variant(beside, [])
            variant = beside.whole(variant)
            values = _best_values(joint.source_of(source.name, variant), channel.machine, rest, variant)
            seen = testable(rest, variant, [])
            verdict = Verdict.RULED_OUT if seen else Verdict.NOT_TESTABLE
            verdict = Verdict.AMBIGUOUS if alike else verdict
            variant = candidate.whole(race.best_variant(candidate, [])[0])
            signature = concealment([channel.joined], machine_columns, variant.columns, variant.plausible, free)
        findings.append(
            SourceFinding(
                name=candidate.name,
                verdict=verdict,
                ambiguous_with=alike,
                gain=gain,
                concealed=signature.share,
                whole_um=1e3 * signature.whole_rms,
                rest_um=1e3 * signature.rest_rms,
                parameters=values,
                text=_text(source, verdict, alike),
            )
        )
    order = [Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.NOT_TESTABLE, Verdict.RULED_OUT]
    return tuple(sorted(findings, key=lambda f: (order.index(f.verdict), -f.gain)))


def _likenesses(
    race: Race, chosen: Sequence[Choice], channel: Channel, sources: Mapping[str, ErrorSource]
) -> dict[str, tuple[str, ...]]:
    """Sources that would do about as well in the place of a chosen one, both ways round.

    What grows with time follows a law of its own in every machine; how exactly one of the laws that are tried fits
    does not tell one such source from another.
    """
    likes: dict[str, list[str]] = {}
    for choice in chosen:
        own = choice.candidate.name
        follows = channel.source_of(own, choice.variant).varies_with
        lawful = [c for c in channel.named if {follows, sources[c.name].varies_with} == {"time"}]
        others = [c for c in channel.named if c not in lawful]
        alike = as_good(race, chosen, choice, others, AS_GOOD)
        if lawful:
            alike += as_good(race, chosen, choice, lawful, max(AS_GOOD, OWN_LAW * worth_of(race, chosen, choice)))
        if any(v.columns.size < choice.candidate.whole(v).columns.size for v in choice.candidate.variants):
            # A source of struts: what others do to the same struts may look the same.
            alike = tuple(dict.fromkeys((*alike, *contained(race, chosen, choice, channel.named, FEW))))
        for rival in alike:
            likes.setdefault(own, []).append(rival)
            likes.setdefault(rival, []).append(own)
    return {name: tuple(sorted(alike)) for name, alike in likes.items()}


def _fitted_values(after: Calibration, name: str) -> dict[str, Value]:
    sigma = uncertainties(after, after.solution.held)
    values: dict[str, Value] = {}
    for term in after.layout.terms:
        if term.source.name == name:
            for k, parameter in enumerate(term.parameters):
                column = term.columns.start + k
                key = parameter.name if not values.get(parameter.name) else f"{parameter.name} ({term.shared})"
                values[key] = Value(float(after.x[column]), float(sigma[column]), parameter.unit)
    return values


def _fitted_amplitudes(after: Calibration, name: str) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Columns of a source's amplitudes in the joint fit and their values: its signature with its shape as fitted."""
    columns, _ = after.layout.columns_of(name)
    return columns, after.x[columns]


def _best_values(source: ErrorSource, machine: Machine, race: Race, variant: Variant) -> dict[str, Value]:
    """Best amplitudes of a source that was not chosen, with the uncertainties that say how much could hide."""
    found = race.amplitudes([variant])
    amplitudes = [p for p in source.parameters(machine) if not p.shape]
    sigma = np.sqrt(np.diag(found.covariance))
    return {p.name: Value(float(found.values[k]), float(sigma[k]), p.unit) for k, p in enumerate(amplitudes)}


def _text(source: ErrorSource, verdict: Verdict, alike: Sequence[str]) -> str:
    if verdict is Verdict.IDENTIFIED:
        return f"{source.texts.what} {source.texts.confirm}"
    if verdict is Verdict.AMBIGUOUS:
        return f"These tests cannot tell it from {', '.join(alike)}. {source.texts.confirm}"
    if verdict is Verdict.NOT_TESTABLE:
        return "These tests would not see it at its usual size: the fitted parameters swallow it."
    return "It would have been seen at its usual size and was not needed."


def doubted(
    findings: Sequence[SourceFinding], rest: Unexplained, sources: Mapping[str, ErrorSource]
) -> tuple[SourceFinding, ...]:
    """Findings where several named sources may be one whose law is not quite what the machine does.

    A warm-up in two stages, for instance: another source that follows the same variable is then called in to make up for
    that. Where this variable still organises what is left, each of them stands, but not beside the others. Where all is
    explained, but of what grows with time one source brings little beside another, that one is in doubt; and so is any that
    brings very little beside a loud one whose law is rough.

    Args:
        findings: as judged.
        rest: what is left.
        sources: by name.
    """
    said = [f for f in findings if f.verdict in {Verdict.IDENTIFIED, Verdict.AMBIGUOUS}]
    follows = {f.name: sources[f.name].varies_with for f in said}
    grows = [f for f in said if follows[f.name] in {"time", "temperature"} and f.gain > AS_GOOD]
    first = max(grows, key=lambda f: f.gain, default=None)
    variable = variable_of(rest.variable) if rest.variable else ""
    variable = "temperature" if variable.endswith("-temperature") else variable
    of_it = {name for name, own in follows.items() if variable and own == variable}
    # A law over time may be another one; thermometers are what they are, only coarse.
    lawful = first is None or follows[first.name] == "time"
    if lawful and len(of_it) > 1:
        return _not_beside(findings, of_it, f"What is left follows {variable} too, so it")
    little = {f.name for f in grows if first is not None and f.gain < MAKES_UP * first.gain}
    if first is not None and little:
        findings = _not_beside(findings, little, f"It brings little beside {first.name}, so it", (first.name,))
    loud = max((f for f in said if sources[f.name].rough), key=lambda f: f.gain, default=None)
    if loud is None:
        return tuple(findings)
    beside = [f for f in said if f.name not in {loud.name, *loud.ambiguous_with} and f.gain > AS_GOOD]
    faint = {f.name for f in beside if f.gain < ROUGHLY * loud.gain}
    return _not_beside(findings, faint, f"It brings very little beside {loud.name}, so it", (loud.name,))


def _not_beside(
    findings: Sequence[SourceFinding], names: set[str], why: str, sure: tuple[str, ...] = ()
) -> tuple[SourceFinding, ...]:
    """Findings of which those named are in doubt: beside those that are sure, or beside each other where none is."""
    told = []
    for finding in findings:
        alike = tuple(sorted({*(sure or names), *finding.ambiguous_with} - {finding.name}))
        text = f"{why} may only make up for another law of {', '.join(sure or alike)}."
        doubtful = replace(finding, verdict=Verdict.AMBIGUOUS, ambiguous_with=alike, text=text)
        told.append(doubtful if finding.name in names else finding)
    return tuple(told)


def beside_outliers(findings: Sequence[SourceFinding], outliers: Sequence[Outlier]) -> tuple[SourceFinding, ...]:
    """Findings where a ball or bar that was set free might be one of the sources as well: neither is sure then."""
    told = []
    for finding in findings:
        alike = tuple(SOURCE_OF[o.kind] for o in outliers if finding.name in o.alike)
        if alike and finding.verdict in {Verdict.RULED_OUT, Verdict.NOT_TESTABLE}:
            text = f"These tests cannot tell it from {', '.join(alike)}."
            told.append(replace(finding, verdict=Verdict.AMBIGUOUS, ambiguous_with=alike, text=text))
        else:
            told.append(finding)
    return tuple(told)


def crowded(findings: Sequence[SourceFinding], chosen: Sequence[Choice], race: Race) -> tuple[SourceFinding, ...]:
    """Findings where three causes or more were needed at once.

    Two happen. Three that none of the others outweighs are more likely one that has no name, put together from what
    has: each may be there, and none of them is sure. A first one that outweighs all others by far stands.
    """
    if len(chosen) < CROWD:
        return tuple(findings)
    variants = [choice.variant for choice in chosen]
    sure = OUTWEIGHS * (race.evidence(variants) - race.evidence(variants[:1])) < race.evidence(variants[:1])
    names = [choice.candidate.name for choice in chosen]
    doubtful = set(names[1:] if sure else names)
    told = []
    for finding in findings:
        if finding.name not in doubtful or finding.verdict is not Verdict.IDENTIFIED:
            told.append(finding)
            continue
        others = tuple(sorted(doubtful - {finding.name}))
        text = f"Several causes are needed together, with {', '.join(others)}: one without a name may be behind them."
        told.append(replace(finding, verdict=Verdict.AMBIGUOUS, ambiguous_with=others, text=text))
    return tuple(told)
