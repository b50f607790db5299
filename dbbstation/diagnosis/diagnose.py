"""The diagnosis: do recordings differ from the model beyond noise, which physics was left out, what does it change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import chi2

from dbbstation.calibration.fit import SMALLEST_NOISE_MM, Calibration, calibrate, default_sources
from dbbstation.calibration.outliers import calibrate_robust
from dbbstation.diagnosis.channel import Channel, channel_of, thinned
from dbbstation.diagnosis.findings import Diagnosis, Location, Shift
from dbbstation.diagnosis.locate import locate, strut_contributions
from dbbstation.diagnosis.next_test import propose
from dbbstation.diagnosis.refit import refitted
from dbbstation.diagnosis.unexplained_model import with_exact_wave
from dbbstation.diagnosis.verdicts import doubted, judge, testable, unexplained
from dbbstation.diagnosis.workspace import workspace_error
from dbbstation.errors import CalibrationError, ModelError
from dbbstation.inference.harmonics import Misfit, misfit
from dbbstation.inference.held_out import HeldOut, held_out
from dbbstation.inference.race import Choice, Race, select, worth_of
from dbbstation.inference.stability import stability
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.findings import NextTest, SourceFinding
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource

THRESHOLD = 6.0
"""Log evidence that a source must bring: odds of 400 to 1 for it."""

MOST_SOURCES = 4
MOST_ROUNDS = 6
"""Times that naming and noise may settle against each other."""

STANDS_OUT_SIGMA = 4.0
"""An amplitude of a named source must stand so far out of its standard deviation in the exact fit."""

SIGNIFICANT = 1e-3
"""Probability below which a misfit counts as one."""

MOST_LOOKS = 3
"""Times that naming and runs that do not belong may settle against each other."""

RIVALS, DRAWS = 6, 20
"""Best sources that compete in each draw of a part of the tests, and draws."""

FOLDS = 5
"""Groups of tests that are left out in turn."""


@dataclass(frozen=True, eq=False)
class Round:
    """One round of naming: a joint fit, its noise, and the race that was run with that noise."""

    chosen: tuple[Choice, ...]
    after: Calibration
    left: Misfit
    race: Race


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
        sources: named candidates; those that lack what they need are left out by the caller.
        progress: told what is being done.

    Raises:
        CalibrationError: the base model cannot be fitted.
        ModelError: a source needs what the runs or the machine file do not give.
    """
    by_name = {source.name: source for source in sources}
    runs = [thinned(observation) for observation in observations]
    progress("kinematic calibration")
    before, outliers = calibrate_robust(partial(calibrate, machine), runs)
    for _ in range(MOST_LOOKS):
        progress("candidates")
        channel = channel_of(before, sources)
        first = misfit_of(before)
        settled = _settle(channel, before, first, by_name, progress)
        if not settled.chosen:
            break
        # What stood out beside a model without physics may not beside one with it, and the other way round.
        again, beside = calibrate_robust(partial(refitted, settled.after), runs)
        if {(o.kind, o.run) for o in beside} == {(o.kind, o.run) for o in outliers}:
            break
        progress("runs that do not belong")
        outliers = beside
        before = calibrate(machine, again.observations)
    chosen, after = settled.chosen, settled.after
    progress("verdicts")
    joint = channel_of(after, sources) if chosen else channel
    findings = judge(channel, settled.race, joint, settled.left.noise, chosen, by_name, after)
    rest = unexplained(channel, joint, first, settled.left, chosen, significant=SIGNIFICANT)
    progress("held-out tests")
    if rest.overrules:
        # Nothing has a name then: what is left, and what could be asked next, is that of the base model.
        chosen, after = (), before
        settled = Round((), before, first, settled.race)
        findings = tuple(rest.demoted(findings))
    findings = doubted(findings, rest.finding, by_name)
    predicted = _held_out(channel, chosen, settled.left.noise)
    steady = _stability(channel, findings, settled)
    findings = tuple(replace(f, stability=steady.get(f.name)) for f in findings)
    progress("next test")
    mismatch = first.probability < SIGNIFICANT or bool(chosen) or bool(outliers)
    found = [by_name[choice.candidate.name] for choice in chosen]
    return Diagnosis(
        mismatch=mismatch,
        misfit=replace(first, probability=min(first.probability, _by_chance(channel, settled))),
        left=settled.left,
        before=before,
        after=after,
        held_out=predicted,
        outliers=outliers,
        workspace=workspace_error(before, after) if chosen else None,
        locations=_locations(before, after, found, first, rest.finding.variable) if mismatch else (),
        sources=findings,
        unexplained=with_exact_wave(rest.finding, after),
        shifts=_shifts(before, after),
        next_test=_next_test(channel, settled, findings, by_name),
    )


def usable_sources(
    machine: Machine, observations: Sequence[Observation], sources: Sequence[ErrorSource]
) -> tuple[list[ErrorSource], dict[str, str]]:
    """Sources that have what they need, and why the others have not, by name."""
    usable, lacking = [], {}
    motions = [observation.motion() for observation in observations]
    for source in sources:
        try:
            source.parameters(machine)
            for motion in motions:
                source.require(motion)
        except ModelError as error:
            lacking[source.name] = error.what
            continue
        if source.of_currents:
            lacking[source.name] = f"{source.name} shows in motor currents only: fit it with `calibrate --sources`"
        else:
            usable.append(source)
    return usable, lacking


def misfit_of(calibration: Calibration) -> Misfit:
    """Misfit of what a fit leaves; where the balls stand in each mounting does not count."""
    fitted = int(np.count_nonzero(~calibration.layout.known.random)) - len(calibration.solution.held)
    # Angles from +X, so that both directions of a mounting have one first harmonic.
    phases = [np.radians(o.raw.theta_deg) for o in calibration.observations]
    groups = [o.setup.mounting for o in calibration.observations]
    return misfit(calibration.residual_mm, phases, groups, fitted)


def _settle(
    channel: Channel,
    before: Calibration,
    first: Misfit,
    sources: dict[str, ErrorSource],
    progress: Callable[[str], None],
) -> Round:
    """Name, fit jointly, drop what the exact fit does not need, read the noise anew, until the names stay.

    The race knows shape parameters at the points of their grids only. Beside a strong source whose time constant
    falls between two points, a second one may seem to be needed; the exact fit then finds no amplitude for it.
    """
    dropped: set[str] = set()
    best = Round((), before, first, channel.race(first.noise))
    for _ in range(MOST_ROUNDS):
        race = channel.race(best.left.noise)
        candidates = [candidate for candidate in channel.named if candidate.name not in dropped]
        chosen = select(race, candidates, THRESHOLD, MOST_SOURCES)
        found = {choice.candidate.name for choice in chosen}
        if found == {choice.candidate.name for choice in best.chosen}:
            break
        progress("joint fit with " + (", ".join(sorted(found)) or "nothing more"))
        try:
            after = _joint(channel, race, chosen, sources) if chosen else before
        except CalibrationError:
            # An amplitude of next to nothing leaves the time constant beside it without a hold.
            dropped.add(min(chosen, key=lambda one: worth_of(race, chosen, one)).candidate.name)
            continue
        weak = {name for name in found if not _stands_out(after, name)}
        left = misfit_of(after)
        if weak:
            dropped |= weak
            best = replace(best, left=left)
        else:
            best = Round(tuple(chosen), after, left, race)
    # Names, fit and what is left of it belong together, whatever ended the rounds.
    left = misfit_of(best.after)
    return replace(best, left=left, race=channel.race(left.noise))


def _by_chance(channel: Channel, settled: Round) -> float:
    """Probability that noise alone lets any candidate explain as much as the best chosen one does; 1 where none is.

    An effect in few of the low harmonics, such as the mean of every run, stands out of them less than by its name.
    """
    tried = sum(len(candidate.variants) for candidate in channel.named)
    found = [(settled.race.explained([c.variant]), len(c.variant.columns)) for c in settled.chosen]
    return min((min(1.0, tried * float(chi2.sf(square, freedom))) for square, freedom in found), default=1.0)


def _stands_out(calibration: Calibration, name: str) -> bool:
    """Whether any amplitude of a source stands out of its standard deviation in an exact fit."""
    sigma = np.sqrt(np.diag(calibration.solution.covariance))
    return any(
        abs(calibration.x[term.columns.start + k]) > STANDS_OUT_SIGMA * sigma[term.columns.start + k]
        for term in calibration.layout.terms
        if term.source.name == name
        for k, parameter in enumerate(term.parameters)
        if not parameter.shape
    )


def _joint(channel: Channel, race: Race, chosen: Sequence[Choice], sources: dict[str, ErrorSource]) -> Calibration:
    """Fit base and chosen sources together, exactly, from the amplitudes that the race found."""
    amplitudes = race.amplitudes([choice.variant for choice in chosen]).values
    start: dict[str, NDArray[np.float64]] = {}
    for choice in chosen:
        source = sources[choice.candidate.name]
        count = len(choice.variant.columns)
        start[source.name] = _with_shape(source, channel.machine, amplitudes[:count], choice.variant.shape)
        amplitudes = amplitudes[count:]
    more = [sources[choice.candidate.name] for choice in chosen]
    return calibrate(channel.machine, channel.observations, [*default_sources(), *more], start)


def _with_shape(
    source: ErrorSource, machine: Machine, amplitudes: NDArray[np.float64], shape: tuple[float, ...]
) -> NDArray[np.float64]:
    """Parameter values from amplitudes and shape values, of the first set where there are several."""
    parameters = source.parameters(machine)
    values = np.empty(len(parameters))
    shaped = np.array([bool(p.shape) for p in parameters])
    values[shaped] = shape
    values[~shaped] = amplitudes[: int((~shaped).sum())]
    return values


def _tests(channel: Channel) -> list[int]:
    """Number of the test of each run, counted in the order of recording."""
    order = {name: k for k, name in enumerate(dict.fromkeys(o.test for o in channel.observations))}
    return [order[o.test] for o in channel.observations]


def _stability(channel: Channel, findings: Sequence[SourceFinding], settled: Round) -> dict[str, float]:
    """How often each of the best sources is chosen again from part of the tests; nothing where none was chosen."""
    if not settled.chosen:
        return {}
    best = {finding.name for finding in sorted(findings, key=lambda f: -f.gain)[:RIVALS]}
    best |= {choice.candidate.name for choice in settled.chosen}
    rivals = [candidate for candidate in channel.named if candidate.name in best]
    return stability(
        channel.blocks,
        _tests(channel),
        channel.base,
        channel.held,
        rivals,
        max(settled.left.noise, SMALLEST_NOISE_MM),
        THRESHOLD,
        MOST_SOURCES,
        DRAWS,
        np.random.default_rng(len(channel.observations)),
    )


def _held_out(channel: Channel, chosen: Sequence[Choice], noise_mm: float) -> tuple[HeldOut, HeldOut]:
    """Predictions of left-out tests without and with the chosen sources [mm]."""
    tests = _tests(channel)
    folds = min(FOLDS, max(tests) + 1)
    groups = [test % folds for test in tests]
    base = np.arange(len(channel.base.prior))
    joint = np.concatenate([base, *(choice.variant.columns for choice in chosen)])
    without, having = (
        held_out(channel.blocks, groups, channel.known, active, max(noise_mm, SMALLEST_NOISE_MM), channel.held)
        for active in (base, joint)
    )
    return without, having


def _locations(
    before: Calibration, after: Calibration, found: Sequence[ErrorSource], first: Misfit, unnamed: str | None
) -> tuple[Location, ...]:
    fitted = [f for f in after.model.sources if f.source in found]
    variable = next((source.varies_with for source in found if source.varies_with), unnamed or "")
    struts = strut_contributions(before, fitted) if fitted else [None] * len(before.observations)
    return locate(before.observations, before.residual_mm, first.noise, struts, variable)


def _shifts(before: Calibration, after: Calibration) -> tuple[Shift, ...]:
    """How far machine parameters had been pulled, largest first; nothing where nothing was found."""
    if after is before:
        return ()
    row_of = {name: k for k, name in enumerate(after.layout.names)}
    sigma = np.sqrt(np.diag(after.solution.covariance))
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


def _next_test(
    channel: Channel, settled: Round, findings: Sequence[SourceFinding], sources: dict[str, ErrorSource]
) -> NextTest | None:
    """Return the test that tells most about the first source that is still open, told apart from its likenesses."""
    variants = {c.name: settled.race.best_variant(c, [])[0] for c in channel.named}
    chosen = [choice.variant for choice in settled.chosen]
    for finding in findings:
        likes = [variants[name] for name in finding.ambiguous_with if name in variants]
        open_question = bool(likes) or not testable(settled.race, variants[finding.name], chosen)
        if open_question and finding.name not in {choice.candidate.name for choice in settled.chosen} - set(
            finding.ambiguous_with
        ):
            variant = variants[finding.name]
            others = [v for v in [*likes, *chosen] if not np.array_equal(v.columns, variant.columns)]
            return propose(channel, sources[finding.name], variant, others, settled.left.noise)
    return None
