"""Diagnose a drive: mass, friction, missing causes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.diagnosis.drive.channel import BASE_UNITS, MASS, METHOD_SHARE, VISCOUS
from dbbstation.diagnosis.drive.explain import explain, held_out, locate
from dbbstation.diagnosis.drive.findings import (
    DriveFinding,
    DriveFindings,
    DriveValue,
    FrictionCurve,
    HeldBack,
    ModelStep,
    ParameterBias,
    RecordedSignals,
    UnexplainedForces,
)
from dbbstation.diagnosis.drive.fit import DriveFit, base_values, fit
from dbbstation.diagnosis.drive.recordings import recordings_of
from dbbstation.diagnosis.drive.sources import force, variable_of
from dbbstation.diagnosis.drive.verdicts import VAGUE, DriveLimits, Verdicts, limits_of, mass_is_known, sentences
from dbbstation.facts import BeforeAfter
from dbbstation.facts.value import Value
from dbbstation.inference.alternatives import cancelling_of
from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.hypotheses import Hypothesis
from dbbstation.inference.left_over import SIGNIFICANT, left_over
from dbbstation.inference.levels import Verdict
from dbbstation.inference.levels_of import detectable_causes, levels_of
from dbbstation.inference.triangle import rms, root

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.diagnosis.drive.explain import ExplainedDrive
    from dbbstation.diagnosis.drive.findings import UnexplainedForce
    from dbbstation.diagnosis.drive.recordings import Recordings
    from dbbstation.laws.contract import TableSource
    from dbbstation.trace.drive import DriveRecording

HELD_BACK = 0.25
"""Final share of the recordings, held out to judge predictions."""


OFFSETS = frozenset({"load_n", "coulomb_asymmetry_n"})
"""Parameters that shift the force equally in both directions."""

GRAVITY_M_S2 = 9.81
"""Acceleration of gravity for constant loads, kept separate from the hexapod's [m/s²]."""


@with_one_thread
def identify(
    recordings: Sequence[DriveRecording],
    sources: Sequence[TableSource],
    cutoff_hz: float | None = None,
    progress: Callable[[str], None] = lambda _: None,
    *,
    hold_out: bool = False,
) -> DriveFindings:
    """Identify a drive beyond mass and viscous friction.

    Args:
        cutoff_hz: of the low-pass; None to choose it from the data.
        hold_out: whether to test on held-out parts, which doubles the time.

    Raises:
        CalibrationError: the recordings do not suffice.
    """
    progress("speed and acceleration")
    put_together = recordings_of(recordings, cutoff_hz)
    progress("sets of causes")
    with np.errstate(over="ignore", under="ignore"):  # very large or small sizes have zero weight
        explained = explain(put_together, sources, progress)
    before, after = explained.before, explained.after
    limits = limits_of(explained)
    held, parts = held_out(explained.drive, progress) if hold_out else (None, None)
    settled, left = explained.settled, left_over(explained.settled)
    reference = None if held is None else held.reference
    levels = levels_of(settled, left, parts, reference=reference, sizes=detectable_causes(settled))
    verdicts = Verdicts(explained, levels, several_speeds=limits.several_speeds, held=held)
    values, scale = base_values(explained.drive, explained.settled, after), put_together.scale
    known = {
        MASS: mass_is_known(limits, values.get(MASS)),
        VISCOUS: limits.several_speeds
        and VISCOUS in values
        and values[VISCOUS].uncertainty < VAGUE * max(values[VISCOUS].value, 0.1 * scale.force_n / scale.speed_m_s),
    }
    named, predicting = verdicts.named, verdicts.predicting
    alone = replace(settled.posterior, hypotheses=(Hypothesis((), 0.0),))
    misfit = left_over(replace(settled, posterior=alone))
    progress("held-back stretch")
    time = put_together.time_s
    held_back = time > np.quantile(time, 1.0 - HELD_BACK)
    ends = time[held_back][[0, -1]]
    mismatch = not misfit.is_noise or bool(named)
    noise, force = explained.settled.noise, put_together.force_n
    base_n, model_n = before.force_n(), after.force_n(predicting)
    chosen = tuple(dict.fromkeys(verdicts.source_of(name) for name in predicting))
    rest = _rest(explained, verdicts, after.force_n(named))
    follows = variable_of(explained.drive.sources[chosen[0]]) if chosen else rest.variable
    steps = tuple(_steps(explained, verdicts, held_back))
    at_first = {name: _number(value, is_known=known[name]) for name, value in before.base.items()}
    numbers = _numbers(explained, values, known, limits)
    return DriveFindings(
        mismatch=mismatch,
        probability=misfit.probability,
        noise_n=noise.sigma,
        noise_correlation_samples=noise.correlation_samples,
        misfit_rms_n=_beyond(force - base_n, noise.sigma),
        residual_rms_n=BeforeAfter(*(rms(force - one) for one in (base_n, model_n))),
        held_back=HeldBack(
            (float(ends[0]), float(ends[1])),
            BeforeAfter(steps[0].relative_force_error, steps[-1].relative_force_error),
            steps,
            tuple(dict.fromkeys(verdicts.source_of(name) for name in named if name not in predicting)),
        ),
        parameters=numbers,
        parameter_shift=tuple(_biases(at_first, numbers)) if chosen else (),
        friction=_per_direction(after, values)
        if limits.several_speeds and limits.reverses and VISCOUS in values
        else {},
        locations=locate(put_together, force - base_n, noise, follows) if mismatch else (),
        sources=tuple(_with_weight(finding, values) for finding in verdicts.findings),
        unexplained=rest,
        cancelling=cancelling_of(settled, "N", {name: verdicts.source_of(name) for name in settled.best.names}),
        cannot_tell=sentences(limits, explained, known),
        held_out="not-tested" if held is None else "tested",
        held_out_rms_n=held,
        signals=_signals(explained),
        noticed=tuple(put_together.notes),
        table=_table(put_together, base_n, model_n),
        before=at_first,
        chosen=chosen,
        curve=_curve(explained),
        levels=levels,
    )


def _table(recordings: Recordings, base_n: Floats, model_n: Floats) -> dict[str, Floats]:
    return {
        "t_s": recordings.time_s,
        "position_mm": 1e3 * recordings.at(lambda s: s.position_m),
        "speed_mm_s": 1e3 * recordings.motion[:, 1],
        "acceleration_mm_s2": 1e3 * recordings.motion[:, 0],
        "force_n": recordings.force_n,
        "base_force_n": base_n,
        "model_force_n": model_n,
    }


def _signals(explained: ExplainedDrive) -> RecordedSignals:
    recordings, shortest = explained.drive.recordings, explained.drive.shortest_wave_mm
    signals, scale = recordings.signals, recordings.scale
    return RecordedSignals(
        recordings=len(signals),
        samples=sum(len(one.t_s) for one in signals),
        samples_compared=len(recordings.force_n),
        rate_hz=signals[0].rate_hz,
        cutoff_hz=scale.cutoff_hz,
        shortest_wave_mm=shortest if np.isfinite(shortest) else None,
        t_s=(float(signals[0].t_s[0]), float(signals[-1].t_s[-1])),
        reversals=sum(len(one.reversals) for one in signals),
        greatest_speed_mm_s=1e3 * scale.speed_m_s,
        force_rms_n=scale.force_n,
    )


def _biases(before: Mapping[str, DriveValue], after: Mapping[str, DriveValue]) -> Iterator[ParameterBias]:
    for name, alone in before.items():
        beside = after[name]
        if alone.identifiable and beside.identifiable:
            shift = alone.value - beside.value
            yield ParameterBias(name, alone.value, beside.value, shift, beside.uncertainty, alone.unit)


def _number(value: Value, *, is_known: bool) -> DriveValue:
    known = value.value if np.isfinite(value.uncertainty) else float("nan")
    return DriveValue(known, value.uncertainty, value.unit, is_known)


def _beyond(residual: Floats, sigma: float) -> float:
    return root(float(np.mean(residual**2)) - sigma**2)


def _rest(explained: ExplainedDrive, verdicts: Verdicts, model_n: Floats) -> UnexplainedForces:
    recordings, settled = explained.drive.recordings, explained.settled
    least = METHOD_SHARE * recordings.scale.force_n
    effects = tuple(effect for effect in verdicts.effects() if effect.rms_n > least)
    left = left_over(settled)
    residual = recordings.force_n - model_n
    rms = _beyond(residual, settled.noise.sigma)

    def rest(
        rms: float, probability: float, variable: str | None, effects: tuple[UnexplainedForce, ...], text: str
    ) -> UnexplainedForces:
        significant = probability < SIGNIFICANT
        where = locate(recordings, residual, settled.noise, variable) if significant else ()
        return UnexplainedForces(rms, probability, significant, variable, text, effects, where)

    if effects:
        variable = effects[0].variable
        probability = 1.0 - effects[0].probability if left.is_noise else left.probability
        return rest(rms, probability, variable, effects, f"A force without a known name, organised by {variable}.")
    if left.is_noise or rms <= least:
        return rest(0.0 if left.is_noise else rms, 1.0, None, (), "Nothing is left beyond noise.")
    look = left.worst
    where = f" ({look.where})" if look.where else ""
    text = f"Something is left beyond noise, which no form describes; it shows most in {look.name}{where}."
    return rest(rms, left.probability, None, (), text)


def _numbers(
    explained: ExplainedDrive, values: dict[str, Value], known: dict[str, bool], limits: DriveLimits
) -> dict[str, DriveValue]:
    nothing = {name: Value(float("nan"), float("inf"), unit) for name, unit in BASE_UNITS.items()}
    numbers = {name: _number((nothing | values)[name], is_known=known[name]) for name in (MASS, VISCOUS)}
    after = explained.after
    for law in after.laws:
        # Load or asymmetric friction: the additional force in one direction.
        found = after.parameters(law)
        for parameter in OFFSETS & set(found):
            numbers["offset_n"] = _number(found[parameter], is_known=limits.reverses)
    return numbers


def _per_direction(fitted: DriveFit, values: dict[str, Value]) -> dict[str, dict[str, Value]]:
    sides = {}
    for side, sign in (("forwards", 1.0), ("backwards", -1.0)):
        dry, wet = np.zeros(len(fitted.values)), np.zeros(len(fitted.values))
        wet[fitted.drive.channel.base.names.index(VISCOUS)] = 1.0
        of_speed = {"coulomb_n": (dry, 1.0), "coulomb_asymmetry_n": (dry, sign), "viscous_asymmetry_n_s_m": (wet, sign)}
        for law in fitted.laws:
            first = fitted.columns_of(law).start
            for k, parameter in enumerate(fitted.drive.of_law[law][1].amplitudes):
                if parameter.name in of_speed:
                    weights, size = of_speed[parameter.name]
                    weights[first + k] = size
        own = fitted.weighted(wet, "N·s/m")
        # The change of viscous friction in other hypotheses applies to both directions.
        between = max(values[VISCOUS].uncertainty ** 2 - fitted.base[VISCOUS].uncertainty ** 2, 0.0)
        sides[side] = {VISCOUS: Value(own.value, float(np.sqrt(own.uncertainty**2 + between)), own.unit)}
        if dry.any():
            sides[side]["coulomb_n"] = fitted.weighted(dry, "N")
    return sides


def _steps(explained: ExplainedDrive, verdicts: Verdicts, held_back: Flags) -> list[ModelStep]:
    drive, settled = explained.drive, explained.settled
    by_name = {member.name: member for member in settled.best.members}
    predicting = verdicts.predicting
    groups = list(dict.fromkeys(verdicts.source_of(name) for name in predicting))
    members, steps = [], []
    for added in ["", *groups]:
        members += [by_name[name] for name in predicting if added and verdicts.source_of(name) == added]
        fitted = fit(drive, settled, members, ~held_back)
        force = drive.recordings.force_n
        left = force - fitted.force_n()
        out, inside = (
            float(np.linalg.norm(left[rows]) / np.linalg.norm(force[rows])) for rows in (held_back, ~held_back)
        )
        steps.append(ModelStep(added or None, out, inside, fitted.all_values()))
    return steps


def _with_weight(finding: DriveFinding, values: dict[str, Value]) -> DriveFinding:
    mass = values.get(MASS)
    load = finding.parameters.get("load_n")
    if (
        finding.verdict not in {Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.DOES_NOT_PREDICT}
        or load is None
        or mass is None
        or mass.value <= 0.0
    ):
        return finding
    share = load.value / (mass.value * GRAVITY_M_S2)
    if abs(share) > 1.0:
        more = "It is more than the weight of the moved mass: no slanted axis alone explains it."
    else:
        more = f"If it is the weight of the moved mass, the axis rises by {np.degrees(np.arcsin(share)):.3g} degrees."
    return replace(finding, text=f"{finding.text} {more}")


def _curve(explained: ExplainedDrive) -> FrictionCurve:
    drive, fitted = explained.drive, explained.after
    recordings, scale = drive.recordings, drive.scale
    speeds = recordings.at(lambda s: s.speed_m_s)
    low, high = float(speeds.min()), float(speeds.max())
    speed = np.linspace(low, high, BOUNDS.friction_points)
    nearest = NEAR_ZERO * scale.speed_m_s
    speed = np.unique(np.concatenate([speed[np.abs(speed) > nearest], [-nearest, nearest]]))
    speed = speed[(speed >= low) & (speed <= high)]
    still = np.zeros_like(speed)
    middle = np.full_like(speed, 0.5 * (scale.low_m + scale.high_m))
    pretended = replace(
        recordings.signals[0],
        t_s=still,
        measured_m=middle,
        position_m=middle,
        speed_m_s=speed,
        way=np.sign(speed),
        acceleration_m_s2=still,
        force_n=still,
    )
    columns = np.zeros((len(speed), len(fitted.values)))
    if VISCOUS in drive.channel.base.names:
        columns[:, drive.channel.base.names.index(VISCOUS)] = speed
    for name in fitted.laws:
        source, form = drive.of_law[name]
        if variable_of(source) == "speed":
            shapes = tuple(fitted.parameters(name)[p.name].value for p in form.shapes)
            columns[:, fitted.columns_of(name)] = force(source, form, shapes)(pretended)
    variance = np.einsum("ij,jk,ik->i", columns, fitted.covariance, columns)
    return FrictionCurve(speed, columns @ fitted.values, np.sqrt(np.maximum(variance, 0.0)))


NEAR_ZERO = 0.01
"""Share of the greatest speed at which the curve starts on each side of standstill."""
