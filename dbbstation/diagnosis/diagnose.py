"""Find missing physics and its consequences; predict held-out tests."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import SIGNIFICANT, fine_noise_mm, is_missing_physics
from dbbstation.calibration.fit.calibrate import SMALLEST_NOISE_MM
from dbbstation.calibration.outliers.stray_balls import beside
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.effects import workspace_error
from dbbstation.diagnosis.explain import explain, without
from dbbstation.diagnosis.findings import Diagnosis, Unexplained
from dbbstation.diagnosis.locate import after_reversals, locations_of
from dbbstation.diagnosis.next_test import next_tests
from dbbstation.diagnosis.shapes import Follows
from dbbstation.diagnosis.unexplained import curve_of, with_exact_wave
from dbbstation.diagnosis.verdicts import CircleJudge, circle_levels, limits_of, outcome_of, shifts_between, where_left
from dbbstation.errors import ModelError
from dbbstation.inference.alternatives import EVEN, Alternatives, cancelling
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.folds import (
    HeldOut,
    columns_of,
    errors_without,
    gains_of_tests,
    groups_of_tests,
    numbered,
    rows_of_groups,
    selection_frequency,
    widening,
)
from dbbstation.inference.harmonics import LOW
from dbbstation.inference.levels import SURE
from dbbstation.inference.model_comparison import all_columns
from dbbstation.inference.settle import BETTER
from dbbstation.inference.square_root import solve
from dbbstation.sources.laws.temperature import not_given
from dbbstation.trace.recording import averaged, means, sector_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.diagnosis.explain import Explained, SettledCircles
    from dbbstation.inference.folds import KnownGains
    from dbbstation.inference.model_comparison import Member
    from dbbstation.inference.settle import Settled
    from dbbstation.inference.square_root import Solution
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import ErrorSource, Motion


@with_one_thread
def diagnose(
    machine: Machine,
    observations: Sequence[Observation],
    sources: Sequence[ErrorSource],
    progress: Callable[[str], None] = lambda _: None,
    *,
    hold_out: bool = True,
    until_interrupted: bool = False,
) -> Diagnosis:
    """Find the physics that a kinematic calibration lacks; see docs/decisions.md, 19.

    Args:
        sources: candidates whose inputs are provided; forms of one cause share a name.
        hold_out: whether to repeat the selection without each group of tests.
        until_interrupted: whether an interruption ends the work and returns findings so far.

    Raises:
        CalibrationError: the base model cannot be fitted.
        ModelError: runs or machine file lack an input.
    """
    most = sectors_for(len(observations))
    runs = [thinned(observation, most) for observation in observations]
    explained = explain(machine, runs, sources, progress, until_interrupted=until_interrupted)
    try:
        return _answered(explained, progress, hold_out=hold_out)
    except KeyboardInterrupt:
        if not until_interrupted:
            raise
    # After an interruption, findings are judged without the long tests.
    return _answered(replace(explained, settled=replace(explained.settled, stopped=True)), progress, hold_out=False)


def _answered(explained: Explained, progress: Callable[[str], None], *, hold_out: bool) -> Diagnosis:
    progress("verdicts")
    explained = without_doubtful(explained)
    progress("held-out tests")
    stopped = explained.settled.stopped
    outcome = outcome_of(explained)
    gains = without_tests(explained, outcome) if hold_out and not stopped else None
    levels = circle_levels(explained, outcome, gains)
    explained = _widened(explained)
    findings = CircleJudge(explained, outcome, gains, levels).findings()
    settled, before, outliers = explained.settled, explained.before, explained.outliers
    after, members = settled.after, settled.members
    rivals = [f.name for f in sorted(findings, key=lambda f: -(f.gain or 0.0))[: BOUNDS.found_again]]
    again = {} if stopped else found_again(explained, outcome, rivals)
    findings = tuple(replace(f, stability=again.get(f.name)) for f in findings)
    rest = _unexplained(explained)
    mismatch = is_missing_physics(explained.first) or bool(members) or bool(outliers) or rest.variable is not None
    held_out = predicted(explained)
    elsewhere = workspace_error(before, after) if members else None
    progress("next test")
    return Diagnosis(
        mismatch=mismatch,
        misfit=explained.first,
        left=settled.left,
        before=before,
        after=after,
        held_out=held_out,
        held_out_worse=None if gains is None else gains.is_worse,
        levels=levels,
        outliers=tuple(beside(outlier, after) for outlier in outliers),
        workspace=elsewhere,
        locations=locations_of(before, settled, explained.first, levels) if mismatch else (),
        sources=findings,
        unexplained=with_exact_wave(rest, after),
        shifts=shifts_between(before, after),
        second_start_agrees=None if stopped else settled.second_start_agrees(),
        cancelling=cancelling({m.name: outcome.effect([m.name]) for m in members}, "µm", 1e3),
        next_tests=() if stopped else next_tests(explained, findings, elsewhere),
        limits=limits_of(settled),
    )


def _widened(explained: Explained) -> Explained:
    before, settled = widened_by_tests(explained.before), explained.settled
    after = before if settled.after is explained.before else widened_by_tests(settled.after)
    return replace(explained, before=before, settled=replace(settled, after=after))


def without_doubtful(explained: Explained) -> Explained:
    """Remove improbable named causes from the joint model until none remains."""
    given_up: set[str] = set()
    while rather_not := doubtful(explained):
        given_up |= rather_not
        explained = without(explained, given_up)
    return explained


def doubtful(explained: Explained) -> set[str]:
    """Return improbable named causes of the best set."""
    # The median probability model predicts best [Barbieri and Berger, Annals of Statistics 32 (2004) 870]. Ambiguous
    # causes remain.
    settled, found = explained.settled, set()
    every = Alternatives(settled, settled.members)
    for name, equal in every.classes.items():
        if len(equal) == 1 and settled.posterior.probability(equal) < EVEN and not every.ambiguity(name):
            found.add(name)
    return found


def _unexplained(explained: Explained) -> Unexplained:
    settled, left = explained.settled, explained.settled.left
    posterior, unmodelled = settled.posterior, settled.unmodelled
    effects = [m for m in settled.best.members if unmodelled.of(m)]
    sure = posterior.probability(unmodelled.follows) >= SURE
    if not effects or not sure:
        if not is_missing_physics(left) and settled.remainder.probability >= SIGNIFICANT:
            return _quick(settled)
        rough = rough_formulas(settled)
        text = "Something is left beyond noise, and no variable organises it clearly."
        if rough:
            text = (
                f"What is left is what the formula of {', '.join(rough)} may be off by: the machine follows it roughly."
            )
        rms_um, where = where_left(settled)
        return Unexplained(max(1e3 * left.rms, rms_um), None, None, 0.0, f"{text} {where}")
    member = max(effects, key=lambda m: settled.best.log_factor(m.name))
    curve = curve_of(explained.channel, settled, member)
    where = "no single strut" if curve.strut is None else f"strut {curve.strut}"
    if len(unmodelled.of(member)) > 1:
        where = f"each strut by its own curve, strut {curve.strut} most"
    text = f"An unmodelled effect, organised by {curve.variable}, {where}."
    rms_um = 1e3 * left.rms if is_missing_physics(left) else curve.unconcealed_um
    gain = settled.best.log_factor(member.name)
    return Unexplained(rms_um, curve.strut, curve.follows, gain, text, curve)


def _quick(settled: SettledCircles) -> Unexplained:
    found = after_reversals(settled.unmodelled.runs, settled.after.residual_mm)
    if found is None or found.louder.probability >= SIGNIFICANT:
        return Unexplained(0.0, None, None, 0.0, "Nothing is left beyond noise.")
    return Unexplained(1e3 * found.louder.beyond, found.strut, Follows("time", "since a reversal"), 0.0, found.text)


def rough_formulas(settled: SettledCircles) -> list[str]:
    """Return named causes that need slack, which the joint fit lacks."""
    evidence = settled.comparison.log_evidence(settled.best.members)
    found = []
    for member in settled.members:
        firm = [replace(m, slack_scale=0.0) if m is member else m for m in settled.best.members]
        if len(member.variant.slack) and evidence - settled.comparison.log_evidence(firm) > BETTER:
            found.append(member.name)
    return found


def usable_sources(
    machine: Machine, observations: Sequence[Observation], sources: Sequence[ErrorSource]
) -> tuple[list[ErrorSource], dict[str, str]]:
    """Return the usable forms of sources, and reasons against unusable ones, by name."""
    usable: list[ErrorSource] = []
    lacking = {}
    motions = [observation.motion() for observation in observations]
    for source in sources:
        forms = [source, *source.other_laws()]
        missing = [_missing(form, machine, motions) for form in forms]
        usable += [form for form, what in zip(forms, missing, strict=True) if not what]
        if all(missing):
            lacking[source.name] = missing[0]
    return usable, lacking


def _missing(source: ErrorSource, machine: Machine, motions: Sequence[Motion]) -> str:
    try:
        source.parameters(machine)
    except ModelError as error:
        return error.what
    only = (
        f"{source.name} shows in motor currents only: fit it with `calibrate --sources`" if source.of_currents else ""
    )
    return not_given(source, motions) or only


def predicted(explained: Explained) -> tuple[HeldOut, HeldOut]:
    """Return prediction errors of held-out tests without and with named causes [mm]."""
    channel, settled = explained.channel, explained.settled
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    single = max(_single_noise_mm(channel.observations, noise_mm, fine_noise_mm(settled.after)), SMALLEST_NOISE_MM)
    without = _errors(explained, settled.members, single)
    return without([member.name for member in settled.members]), without(())


def _errors(
    explained: Explained, members: Sequence[Member], single: float | None = None
) -> Callable[[Collection[str]], HeldOut]:
    channel, settled, variants = explained.channel, explained.settled, [member.variant for member in members]
    blocks = channel.blocks(all_columns(variants), channel.target(settled.after))
    tests, widths = [o.test for o in channel.observations], {member.name: member.width for member in members}
    noise_mm = max(settled.noise_mm, SMALLEST_NOISE_MM)
    return errors_without(blocks, tests, channel.known_with(variants), widths, noise_mm, channel.held, single)


def without_tests(explained: Explained, outcome: Settled) -> KnownGains | None:
    """Return gains of named causes and classes in groups of tests; None for few tests or without causes.

    The reference is the kinematic calibration of the same tests.
    """
    channel = explained.channel
    # A displaced ball stays in its test.
    members = [member for member in explained.settled.best.members if not member.cause.setup]
    return gains_of_tests(
        outcome,
        rows_of_groups(groups_of_tests([o.test for o in channel.observations]), channel.runs),
        partial(_errors, explained, members),
        lambda cause: cause.named,
        most_members=BOUNDS.members,
        likely=BOUNDS.close,
        thorough=False,
    )


def found_again(explained: Explained, outcome: Settled, names: Sequence[str]) -> dict[str, float]:
    """Return selection frequencies of causes in draws of seven tenths of tests; may be empty."""
    channel, settled = explained.channel, explained.settled
    if not settled.members:
        return {}
    causes = [cause for cause in settled.causes if cause.name in {*names, *settled.best.names}]
    lengths, used = [rows.stop - rows.start for rows in channel.runs], columns_of(causes)
    return selection_frequency(
        numbered([o.test for o in channel.observations]),
        causes,
        lambda out: outcome.bank.without(np.repeat(out, lengths), used),
        np.random.default_rng(len(channel.observations)),
        settled.best.members,
        BOUNDS.members,
    )


def widened_by_tests(calibration: Calibration) -> Calibration:
    """Return the fit with the larger of its uncertainties and jackknife uncertainties over tests.

    The selection, correlations [`widening`] and stated sizes of random effects do not change. With fewer than
    `LEAST_PARTS` groups the fit does not change.
    """
    groups = groups_of_tests([o.test for o in calibration.observations])
    if not groups:
        return calibration
    known, noise = calibration.layout.known, calibration.noise.effective
    held, behind = calibration.solution.held, calibration.blocks[len(groups) :]

    def without(group: int | None) -> Solution:
        circles = [block for block, own in zip(calibration.circle_blocks, groups, strict=True) if own != group]
        return solve([*circles, *behind], known, noise, held)

    of_all, others = without(None), [without(group) for group in np.unique(groups)]
    moved = np.array([other.x - of_all.x for other in others])
    variances = [solution.variance for solution in (of_all, *others)]
    factor = np.where(known.random, 1.0, widening(variances[0], moved, np.array(variances[1:])))
    spreads = calibration.solution.spreads.times(factor)
    return replace(calibration, solution=replace(calibration.solution, spreads=spreads))


def _single_noise_mm(observations: Sequence[Observation], noise_mm: float, fine_mm: float) -> float:
    """Return a single sample's noise if low harmonics have more noise than high ones [mm]."""
    samples = float(np.mean([len(o.raw) for o in observations]))
    low = min((2 * LOW + 1) / samples, 1.0)
    return float(np.sqrt(low * noise_mm**2 + (1.0 - low) * min(fine_mm, noise_mm) ** 2))


MOST_SAMPLES = 30 * BOUNDS.samples_per_turn
"""Most samples of all runs in a diagnosis, as for thirty circles. Columns of all causes then take 0.9 GB, most of its memory."""

LEAST_SECTORS = BOUNDS.samples_per_turn // 2
"""Least samples per turn for any number of runs; with fewer, noise cannot be estimated far above the low harmonics."""


def sectors_for(runs: int) -> int:
    """Return the number of samples per turn for a number of runs."""
    return max(min(BOUNDS.samples_per_turn, MOST_SAMPLES // max(runs, 1)), LEAST_SECTORS)


def thinned(observation: Observation, most: int = BOUNDS.samples_per_turn) -> Observation:
    """Return the run averaged over sectors, with its commands; short runs are unchanged."""
    raw = observation.raw
    if len(raw) <= most:
        return observation
    sectors = min(most, max(len(raw) // BOUNDS.samples_per_sector, 1))
    most_fine = BOUNDS.samples_of_sharp * sectors
    finer = _averaged(observation, most_fine) if len(raw) > most_fine else observation
    return replace(_averaged(finer, sectors), finer=(finer, sector_of(finer.raw, sectors)))


def _averaged(observation: Observation, sectors: int) -> Observation:
    raw, commanded = observation.raw, observation.commanded
    if commanded is not None:
        before = len(observation.lead_in_deg)
        commanded = np.vstack([commanded[:before], means(commanded[before:], sector_of(raw, sectors))])
    return replace(observation, raw=averaged(raw, sectors), commanded=commanded)
