"""Find missing physics and its consequences."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from dbbstation.calibration.checks.scatter import SIGNIFICANT, is_missing_physics, remainder_of
from dbbstation.calibration.outliers.stray_balls import beside
from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.after_reversals import after_reversals
from dbbstation.diagnosis.explain import explain, without
from dbbstation.diagnosis.findings import Diagnosis, Unexplained
from dbbstation.diagnosis.held import shifts_between
from dbbstation.diagnosis.left_out import found_again, predicted, widened_by_tests, without_tests
from dbbstation.diagnosis.limits import limits_of, where_left
from dbbstation.diagnosis.locate import locations_of
from dbbstation.diagnosis.next_test import next_tests
from dbbstation.diagnosis.shapes import Follows
from dbbstation.diagnosis.thinned import sectors_for, thinned
from dbbstation.diagnosis.unexplained import curve_of, with_exact_wave
from dbbstation.diagnosis.verdicts import circle_levels, judge, outcome_of
from dbbstation.diagnosis.workspace import workspace_error
from dbbstation.errors import ModelError
from dbbstation.inference.alternatives import EVEN, Alternatives
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.cancelling import cancelling
from dbbstation.inference.settle import BETTER
from dbbstation.inference.verdict import SURE
from dbbstation.sources.laws.temperature import not_given

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.diagnosis.explained import Explained, SettledCircles
    from dbbstation.inference.harmonics import Misfit
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
    anew = None if gains is None else gains.anew
    levels = circle_levels(explained, outcome, gains)
    explained = _widened(explained)
    findings = judge(explained, outcome, anew, levels)
    settled, before, outliers = explained.settled, explained.before, explained.outliers
    after, members = settled.after, settled.members
    rivals = [f.name for f in sorted(findings, key=lambda f: -(f.gain or 0.0))[: BOUNDS.found_again]]
    again = {} if stopped else found_again(explained, outcome, rivals)
    findings = tuple(replace(f, stability=again.get(f.name)) for f in findings)
    rest = _unexplained(explained, settled.left)
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
        chosen_anew=anew,
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


def _unexplained(explained: Explained, left: Misfit) -> Unexplained:
    settled = explained.settled
    posterior, unmodelled = settled.posterior, settled.unmodelled
    effects = [m for m in settled.best.members if unmodelled.of(m)]
    sure = posterior.probability(unmodelled.follows) >= SURE
    if not effects or not sure:
        found = remainder_of(settled.after, settled.noise)
        if not is_missing_physics(left) and found.probability >= SIGNIFICANT:
            return _quick(settled)
        rough = rough_formulas(settled)
        text = "Something is left beyond noise, and no variable organises it clearly."
        if rough:
            text = (
                f"What is left is what the formula of {', '.join(rough)} may be off by: the machine follows it roughly."
            )
        rms_um, where = where_left(settled.after.observations, found)
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
    if found is None or found.probability >= SIGNIFICANT:
        return Unexplained(0.0, None, None, 0.0, "Nothing is left beyond noise.")
    return Unexplained(found.beyond_um, found.strut, Follows("time", "since a reversal"), 0.0, found.text)


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
