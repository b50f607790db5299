"""The diagnosis of a drive: mass and friction, which causes the base model leaves out, and what they are worth."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.design import BASE, design_of
from dbbstation.diagnosis.drive.findings import Curve, DriveDiagnosis, DriveFinding, Number, Rest, Step
from dbbstation.diagnosis.drive.fit import DriveFit, Term, base_values, fit, term_of, with_method
from dbbstation.diagnosis.drive.judge import (
    METHOD_SHARE,
    SIGNIFICANT,
    by_chance,
    doubtful,
    judge,
    overruled,
    rest_of,
    share_of_force,
)
from dbbstation.diagnosis.drive.limits import Limits, limits_of, mass_is_known, told
from dbbstation.diagnosis.drive.locate import locate
from dbbstation.diagnosis.drive.signals import signals_of
from dbbstation.diagnosis.findings import Value, Verdict
from dbbstation.errors import CalibrationError
from dbbstation.inference.race import Choice, Race, select, worth_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.contract import DriveSource
    from dbbstation.diagnosis.drive.design import Design
    from dbbstation.inference.race import Candidate
    from dbbstation.trace.drive_recording import DriveRecording

THRESHOLD = 6.0
"""Log evidence that a cause must bring: odds of 400 to 1 for it."""

MOST_SOURCES = 5

STANDS_OUT_SIGMA = 4.0
"""An amplitude of a named cause must stand so far out of its standard uncertainty in the exact fit."""

WRONG_SIGN_SIGMA = 5.0
"""Standard uncertainties below zero beyond which a mass or a friction is no chance."""

HELD_BACK = 0.25
"""Share of the recording, its end, that prediction is judged by."""

CURVE_POINTS = 81

OFFSETS = frozenset({"load_n", "coulomb_asymmetry_n"})
"""Parameters that shift the force of both directions alike."""


def identify(
    recording: DriveRecording,
    sources: Sequence[DriveSource],
    cutoff_hz: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> DriveDiagnosis:
    """Identify a drive and find what a model of mass and viscous friction leaves out.

    Args:
        recording: raw.
        sources: causes to look for.
        cutoff_hz: of the band in which force and model are compared; chosen from the data if None.
        progress: told what is being done.

    Raises:
        CalibrationError: the recording cannot carry an identification at all.
    """
    progress("speed and acceleration")
    signals = signals_of(recording, cutoff_hz)
    progress("columns")
    design = design_of(signals, sources)
    narrow = _in_half_the_band(recording, design)
    limits = limits_of(design)
    before = _joint(design, narrow, ())
    _refuse_wrong_sign(before, recording.name)
    progress("candidates")
    race, named, unnamed = design.race(before.columns)
    chosen, after = _chosen(design, narrow, race, named)
    progress("verdicts")
    findings = judge(design, race, chosen, after)
    withdrawn = overruled(race, unnamed, chosen)
    if withdrawn:
        chosen = [choice for choice in chosen if choice.candidate.name not in withdrawn]
        after = _joint(design, narrow, chosen)
        findings = judge(design, race, chosen, after)
        findings = tuple(_withdrawn(f) if f.name in withdrawn else f for f in findings)
    rest = rest_of(design, after)
    suspects = doubtful(race, unnamed, chosen, rest)
    if suspects:
        # What may only make up for another law must not pull the values of what stands.
        findings = tuple(_doubted(f, rest.variable or "") if f.name in suspects else f for f in findings)
        chosen = [choice for choice in chosen if choice.candidate.name not in suspects]
        after = _joint(design, narrow, chosen)
        rest = rest_of(design, after)
        findings = tuple(_as_fitted(finding, after) for finding in findings)
    findings = tuple(_with_caution(design, finding, rest) for finding in findings)
    probability, misfit_n = by_chance(design, before.square, before.columns.shape[1])
    held_back = signals.t_s[signals.kept] > np.quantile(signals.t_s[signals.kept], 1.0 - HELD_BACK)
    mismatch = probability < SIGNIFICANT or bool(chosen)
    progress("held-back stretch")
    ends = signals.t_s[signals.kept][held_back][[0, -1]]
    return DriveDiagnosis(
        design=design,
        mismatch=mismatch,
        misfit_rms_n=misfit_n,
        probability=probability,
        before=_numbers(before, limits),
        after=_numbers(after, limits),
        friction=_per_direction(after, limits),
        chosen=tuple(term.name for term in after.terms),
        base_n=before.force_n,
        model_n=after.force_n,
        held_back_s=(float(ends[0]), float(ends[1])),
        steps=tuple(_steps(design, after.terms, held_back)),
        locations=locate(design, design.force_n - before.force_n) if mismatch else (),
        findings=findings,
        rest=rest,
        rest_locations=locate(design, design.force_n - after.force_n) if rest.probability < SIGNIFICANT else (),
        cannot_tell=told(limits, design, before, after),
        curve=_curve(design, after),
    )


def _refuse_wrong_sign(before: DriveFit, name: str) -> None:
    """Refuse a force that points against what it drives.

    Raises:
        CalibrationError: mass or friction comes out negative beyond doubt.
    """
    for parameter, value in base_values(before).items():
        if value.value < -WRONG_SIGN_SIGMA * value.uncertainty:
            raise CalibrationError(
                f"the force has the wrong sign: {parameter} comes out at {value.value:.3g} {value.unit}",
                where=name,
                remedy="force and current must be positive towards greater positions; turn the sign of one channel",
            )


def _chosen(
    design: Design, narrow: Design | None, race: Race, named: Sequence[Candidate]
) -> tuple[list[Choice], DriveFit]:
    """Select causes, fit them exactly, drop those that do not stand out of their uncertainty, and forms that cannot be.

    What explains most beside the others comes first.
    """
    left = {candidate.name: candidate for candidate in named}
    while True:
        chosen = select(race, list(left.values()), THRESHOLD, MOST_SOURCES)
        worth = [worth_of(race, chosen, one) for one in chosen]
        chosen = [chosen[k] for k in np.argsort(worth)[::-1]]
        after = _joint(design, narrow, chosen)
        values = after.all_values()
        impossible = [one for one in chosen if not design.sources[one.candidate.name].possible(values)]
        for one in impossible:
            # Another form of it may still be right, beside something else.
            forms = tuple(v for v in left[one.candidate.name].variants if v is not one.variant)
            left[one.candidate.name] = replace(one.candidate, variants=forms)
            if not forms:
                del left[one.candidate.name]
        if impossible:
            continue
        out = {term.name: _stands_out(after, term) for term in after.terms}
        # Less than low-pass and differences leave of a perfect drive has no name, however well it stands out.
        out |= {one.candidate.name: 0.0 for one in chosen if share_of_force(design, race, chosen, one) < METHOD_SHARE}
        weakest = min(out, key=out.__getitem__, default=None)
        if weakest is None or out[weakest] > STANDS_OUT_SIGMA:
            return chosen, after
        del left[weakest]


def _joint(design: Design, narrow: Design | None, chosen: Sequence[Choice]) -> DriveFit:
    """Base and chosen causes fitted together, exactly, with all that is known of their uncertainty."""
    fitted = fit(design, [term_of(design, c.candidate, c.variant) for c in chosen])
    return with_method(fitted, None if narrow is None else fit(narrow, fitted.terms))


def _stands_out(fitted: DriveFit, term: Term) -> float:
    """Greatest amplitude of a cause in units of its standard uncertainty."""
    rows = fitted.amplitudes(term.name)
    return float(np.max(np.abs(fitted.values[rows]) / np.sqrt(np.diag(fitted.covariance)[rows])))


def _as_fitted(finding: DriveFinding, fitted: DriveFit) -> DriveFinding:
    """The finding with the values of the last model, where its cause is in it."""
    if finding.name not in {term.name for term in fitted.terms}:
        return finding
    return replace(finding, parameters=fitted.parameters(finding.name))


def _in_half_the_band(recording: DriveRecording, design: Design) -> Design | None:
    """The same recording in half the band; None where it is too short for that."""
    try:
        return design_of(signals_of(recording, 0.5 * design.signals.cutoff_hz), list(design.sources.values()))
    except CalibrationError:
        return None


def _withdrawn(finding: DriveFinding) -> DriveFinding:
    text = "It explains part of the misfit, but clearly less than a force without a name does."
    return replace(finding, verdict=Verdict.RULED_OUT, ambiguous_with=(), text=text)


def _with_caution(design: Design, finding: DriveFinding, rest: Rest) -> DriveFinding:
    """Say of a name that stands where what is left follows the same variable."""
    if finding.verdict is not Verdict.IDENTIFIED or design.sources[finding.name].varies_with != rest.variable:
        return finding
    return replace(finding, text=f"{finding.text} What is left follows {rest.variable} too: its law is not quite this.")


def _doubted(finding: DriveFinding, variable: str) -> DriveFinding:
    text = f"What is left without a name follows {variable} and is of its size: it may only make up for another law, and is not in the model."
    return replace(finding, verdict=Verdict.AMBIGUOUS, text=text)


def _numbers(fitted: DriveFit, limits: Limits) -> dict[str, Number]:
    """Base parameters, and what shifts the force of both directions."""
    values = base_values(fitted)
    known = {BASE[0]: mass_is_known(limits, fitted), BASE[1]: limits.several_speeds}
    numbers = {name: Number(values[name], known[name]) for name in BASE}
    for term in fitted.terms:
        # Whether it is a load or asymmetric friction, it is what the drive needs more one way than the other.
        for parameter in OFFSETS & {p.name for p in term.form.amplitudes}:
            numbers["offset_n"] = Number(fitted.parameters(term.name)[parameter], limits.reverses)
    return numbers


def _per_direction(fitted: DriveFit, limits: Limits) -> dict[str, dict[str, Value]]:
    """Coulomb and viscous friction forwards and backwards, with the asymmetry where it was found."""
    if not (limits.several_speeds and limits.reverses):
        return {}
    sides = {}
    for side, sign in (("forwards", 1.0), ("backwards", -1.0)):
        dry, wet = np.zeros(len(fitted.values)), np.zeros(len(fitted.values))
        wet[BASE.index("viscous_n_s_m")] = 1.0
        for term in fitted.terms:
            first = fitted.amplitudes(term.name).start
            for k, parameter in enumerate(term.form.amplitudes):
                if parameter.name == "coulomb_n":
                    dry[first + k] = 1.0
                elif parameter.name == "coulomb_asymmetry_n":
                    dry[first + k] = sign
                elif parameter.name == "viscous_asymmetry_n_s_m":
                    wet[first + k] = sign
        sides[side] = {"viscous_n_s_m": _weighted(fitted, wet, "N·s/m")}
        if dry.any():
            sides[side]["coulomb_n"] = _weighted(fitted, dry, "N")
    return sides


def _weighted(fitted: DriveFit, weights: NDArray[np.float64], unit: str) -> Value:
    return Value(float(weights @ fitted.values), float(np.sqrt(weights @ fitted.covariance @ weights)), unit)


def _steps(design: Design, terms: Sequence[Term], held_back: NDArray[np.bool_]) -> list[Step]:
    """Base and one cause after another, each fitted without the held-back stretch and judged on it."""
    steps = []
    for count in range(len(terms) + 1):
        fitted = fit(design, terms[:count], ~held_back)
        left = design.force_n - fitted.force_n
        out, inside = (
            float(np.linalg.norm(left[rows]) / np.linalg.norm(design.force_n[rows])) for rows in (held_back, ~held_back)
        )
        steps.append(Step(terms[count - 1].name if count else "", out, inside, fitted.all_values()))
    return steps


def _curve(design: Design, fitted: DriveFit) -> Curve:
    """Friction against speed as fitted: viscous friction and all causes that hang on the speed."""
    top = design.signals.scale.speed_m_s
    low, high = float(design.signals.speed_m_s.min()), float(design.signals.speed_m_s.max())
    speed = np.linspace(low, high, CURVE_POINTS)
    speed = np.unique(np.concatenate([speed, [-1e-3 * top, 1e-3 * top]]))
    speed = speed[(speed >= low) & (speed <= high)]
    still = np.zeros_like(speed)
    pretended = replace(
        design.signals,
        t_s=still,
        measured_m=still,
        position_m=still,
        speed_m_s=speed,
        acceleration_m_s2=still,
        force_n=still,
    )
    columns = np.zeros((len(speed), len(fitted.values)))
    columns[:, BASE.index("viscous_n_s_m")] = speed
    for term in fitted.terms:
        if design.sources[term.name].varies_with == "speed":
            columns[:, fitted.amplitudes(term.name)] = term.form.columns(pretended, term.value)
    variance = np.einsum("ij,jk,ik->i", columns, fitted.covariance, columns)
    return Curve(speed, columns @ fitted.values, np.sqrt(variance))
