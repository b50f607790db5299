"""The diagnosis: do recordings differ from the model beyond noise, which physics was left out, what does it change."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from dbbstation.calibration.fit import SMALLEST_NOISE_MM, Calibration
from dbbstation.calibration.missing_physics import SIGNIFICANT
from dbbstation.calibration.noise_level import fine_noise_mm
from dbbstation.calibration.stray_balls import beside
from dbbstation.diagnosis.channel import Channel, channel_of, thinned
from dbbstation.diagnosis.findings import Diagnosis, Location, Shift
from dbbstation.diagnosis.held import held_beside, uncertainties
from dbbstation.diagnosis.locate import locate, strut_contributions
from dbbstation.diagnosis.naming import MOST_SOURCES, THRESHOLD, Round, best_look
from dbbstation.diagnosis.next_test import propose
from dbbstation.diagnosis.unexplained import unexplained
from dbbstation.diagnosis.unexplained_model import with_exact_wave
from dbbstation.diagnosis.verdicts import beside_outliers, crowded, doubted, judge, testable
from dbbstation.diagnosis.workspace import WorkspaceError, workspace_error
from dbbstation.errors import ModelError
from dbbstation.inference.harmonics import LOW
from dbbstation.inference.held_out import HeldOut, held_out
from dbbstation.inference.stability import stability
from dbbstation.sources.by_temperature import not_given
from dbbstation.sources.contract import Need, Owner

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.findings import NextTest, SourceFinding
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.race import Choice
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion

RIVALS, DRAWS = 6, 20
"""Best sources that compete in each draw of a part of the tests, and draws."""

FOLDS = 5
"""Groups of tests that are left out in turn."""


def diagnose(
    machine: Machine,
    observations: Sequence[Observation],
    sources: Sequence[ErrorSource],
    progress: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Find what a kinematic calibration leaves out.

    Args:
        machine: nominal machine.
        observations: raw runs.
        sources: named candidates, several forms of one cause under one name; those that lack what they need are left out
            by the caller.
        progress: told what is being done.

    Raises:
        CalibrationError: the base model cannot be fitted.
        ModelError: a source needs what the runs or the machine file do not give.
    """
    by_name = {source.name: source for source in reversed(sources)}
    runs = [thinned(observation) for observation in observations]
    look = best_look(machine, runs, sources, progress)
    before, outliers, channel, first, settled = look.before, look.outliers, look.channel, look.first, look.settled
    chosen, after = settled.chosen, settled.after
    progress("verdicts")
    joint = channel_of(after, sources) if chosen else channel
    findings = judge(channel, settled.race, joint, settled.left.noise, chosen, by_name, after)
    rest = unexplained(before, after, settled.race, first, settled.left, chosen, significant=SIGNIFICANT)
    progress("held-out tests")
    if rest.overrules:
        # Nothing has a name then: what is left, and what could be asked next, is that of the base model.
        chosen, after = (), before
        settled = Round((), before, first, settled.race)
        findings = tuple(rest.demoted(findings))
    findings = beside_outliers(findings, outliers)
    found = {c.candidate.name: channel.source_of(c.candidate.name, c.variant) for c in chosen}
    findings = crowded(doubted(findings, rest.finding, {**by_name, **found}), chosen, settled.race)
    predicted = _held_out(channel, chosen, settled.left.noise, fine_noise_mm(after))
    steady = _stability(channel, findings, settled)
    findings = tuple(replace(f, stability=steady.get(f.name)) for f in findings)
    elsewhere = workspace_error(before, after) if chosen else None
    progress("next test")
    mismatch = first.probability < SIGNIFICANT or bool(chosen) or bool(outliers) or rest.found
    return Diagnosis(
        mismatch=mismatch,
        misfit=replace(first, probability=min(first.probability, _by_chance(channel, settled))),
        left=settled.left,
        before=before,
        after=after,
        held_out=predicted,
        outliers=tuple(beside(outlier, after) for outlier in outliers),
        workspace=elsewhere,
        locations=locations_of(before, after, [*found.values()], first, rest.finding.variable) if mismatch else (),
        sources=findings,
        unexplained=with_exact_wave(rest.finding, after),
        shifts=shifts_between(before, after),
        next_tests=_next_tests(channel, settled, findings, known=_known_elsewhere(elsewhere)),
    )


def usable_sources(
    machine: Machine, observations: Sequence[Observation], sources: Sequence[ErrorSource]
) -> tuple[list[ErrorSource], dict[str, str]]:
    """Sources that have what they need, in every form for which that is so, and why the others have not, by name."""
    usable: list[ErrorSource] = []
    lacking = {}
    motions = [observation.motion() for observation in observations]
    for source in sources:
        logged = source.by_temperature()
        forms = [source] if logged is None else [source, logged]
        missing = [_missing(form, machine, motions) for form in forms]
        usable += [form for form, what in zip(forms, missing, strict=True) if not what]
        if all(missing):
            lacking[source.name] = missing[0]
    return usable, lacking


def _missing(source: ErrorSource, machine: Machine, motions: Sequence[Motion]) -> str:
    """Return why a source cannot be a candidate; empty where it can."""
    try:
        source.parameters(machine)
    except ModelError as error:
        return error.what
    only = (
        f"{source.name} shows in motor currents only: fit it with `calibrate --sources`" if source.of_currents else ""
    )
    return not_given(source, motions) or only


def _by_chance(channel: Channel, settled: Round) -> float:
    """Probability that noise alone lets any candidate explain as much as the best chosen one does; 1 where none is.

    An effect in few of the low harmonics, such as the mean of every run, stands out of them less than by its name.
    """
    tried = sum(len(candidate.variants) for candidate in channel.named)
    found = [(settled.race.explained([c.variant]), len(c.variant.columns)) for c in settled.chosen]
    return min((min(1.0, tried * float(chi2.sf(square, freedom))) for square, freedom in found), default=1.0)


def tests_of(observations: Sequence[Observation]) -> list[int]:
    """Number of the test of each run, counted in the order of recording."""
    order = {name: k for k, name in enumerate(dict.fromkeys(o.test for o in observations))}
    return [order[o.test] for o in observations]


def _stability(channel: Channel, findings: Sequence[SourceFinding], settled: Round) -> dict[str, float]:
    """How often each of the best sources is chosen again from part of the tests; nothing where none was chosen."""
    if not settled.chosen:
        return {}
    best = {finding.name for finding in sorted(findings, key=lambda f: -f.gain)[:RIVALS]}
    best |= {choice.candidate.name for choice in settled.chosen}
    rivals = [candidate for candidate in channel.named if candidate.name in best]
    return stability(
        channel.blocks,
        tests_of(channel.observations),
        channel.base,
        channel.held,
        rivals,
        max(settled.left.noise, SMALLEST_NOISE_MM),
        THRESHOLD,
        MOST_SOURCES,
        DRAWS,
        np.random.default_rng(len(channel.observations)),
    )


def _held_out(channel: Channel, chosen: Sequence[Choice], noise_mm: float, fine_mm: float) -> tuple[HeldOut, HeldOut]:
    """Predictions of left-out tests without and with the chosen sources [mm].

    Where neighbouring samples resemble each other the low harmonics, few of all, have more noise than the fine ones.
    """
    single = single_noise_mm(channel.observations, noise_mm, fine_mm)
    tests = tests_of(channel.observations)
    folds = min(FOLDS, max(tests) + 1)
    groups = [test % folds for test in tests]
    base = np.arange(len(channel.base.prior))
    joint = np.concatenate([base, *(choice.variant.columns for choice in chosen)])
    without, having = (
        held_out(
            channel.blocks,
            groups,
            channel.known,
            active,
            max(noise_mm, SMALLEST_NOISE_MM),
            channel.held,
            max(single, SMALLEST_NOISE_MM),
        )
        for active in (base, joint)
    )
    return without, having


def single_noise_mm(observations: Sequence[Observation], noise_mm: float, fine_mm: float) -> float:
    """Noise of a single sample, where the low harmonics, few of all, feel more of it than the fine ones [mm]."""
    samples = float(np.mean([len(o.raw) for o in observations]))
    low = min((2 * LOW + 1) / samples, 1.0)
    return float(np.sqrt(low * noise_mm**2 + (1.0 - low) * min(fine_mm, noise_mm) ** 2))


def locations_of(
    before: Calibration, after: Calibration, found: Sequence[ErrorSource], first: Misfit, unnamed: str | None
) -> tuple[Location, ...]:
    """Where what the base model leaves is largest, and which strut the found sources say most of it comes from.

    Args:
        before: the base fit.
        after: the joint fit.
        found: sources that were named.
        first: misfit of the base fit.
        unnamed: variable of what has no name; None where nothing organises it.
    """
    fitted = [f for f in after.model.sources if f.source in found]
    variable = next((source.varies_with for source in found if source.varies_with), unnamed or "")
    struts = strut_contributions(before, fitted) if fitted else [None] * len(before.observations)
    return locate(before.observations, before.residual_mm, first.noise, struts, variable)


def shifts_between(before: Calibration, after: Calibration) -> tuple[Shift, ...]:
    """How far machine parameters had been pulled, largest first; nothing where nothing was found."""
    if after is before:
        return ()
    row_of = {name: k for k, name in enumerate(after.layout.names)}
    sigma = uncertainties(after, held_beside(before, after))
    shifts = []
    for term in before.layout.terms:
        if term.source.belongs_to is not Owner.MACHINE:
            continue
        for k, parameter in enumerate(term.parameters):
            row = row_of[term.source.name, term.shared, parameter.name]
            old, new = before.x[term.columns.start + k], after.x[row]
            name = f"{term.source.name} {parameter.name.removesuffix('_mm')}"
            shifts.append(Shift(name, 1e3 * float(old), 1e3 * float(new), 1e3 * float(sigma[row])))
    return tuple(sorted(shifts, key=lambda shift: -abs(shift.shift_um)))


def _known_elsewhere(found: WorkspaceError | None) -> bool:
    """Whether the joint model knows the workspace better than what it corrects there."""
    return found is None or found.uncertainty_um < found.rms_um


def _next_tests(
    channel: Channel,
    settled: Round,
    findings: Sequence[SourceFinding],
    *,
    known: bool,
) -> tuple[NextTest, ...]:
    """Return the tests that tell most about the first source that is still open, told apart from its likenesses.

    A source that was named is open too, where the joint model is not `known` well enough to be of use elsewhere.
    """
    variants = {c.name: c.whole(settled.race.best_variant(c, [])[0]) for c in channel.named}
    chosen = {choice.candidate.name: choice.candidate.whole(choice.variant) for choice in settled.chosen}
    for finding in findings:
        likes = [name for name in finding.ambiguous_with if name in variants]
        settled_name = finding.name in chosen and (known or len(chosen[finding.name].columns) == 1)
        if not likes and (
            settled_name
            or (finding.name not in chosen and testable(settled.race, variants[finding.name], [*chosen.values()]))
        ):
            continue
        beside = {**{name: variants[name] for name in likes}, **chosen}
        beside.pop(finding.name, None)
        asked = {finding.name: variants[finding.name], **beside}
        # Nobody knows what a thermometer would show in a test to come: what follows one is taken as known.
        forms = [(channel.source_of(name, variant), variant) for name, variant in asked.items()]
        foreseen = [(source, variant) for source, variant in forms if Need.TEMPERATURE not in source.needs]
        if not foreseen or foreseen[0][0].name != finding.name:
            continue
        found = propose(channel, foreseen, settled.left.noise)
        if found:
            return found
    return ()
