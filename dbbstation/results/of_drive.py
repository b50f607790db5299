"""From the diagnosis of a drive to its result."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.drive.naming import acts
from dbbstation.inference.left_over import SIGNIFICANT
from dbbstation.results.drive import (
    CausePart,
    ComplementResult,
    DriveCause,
    DriveResult,
    DriveValue,
    ForceErrors,
    ForceLocation,
    HeldBack,
    HeldOutForce,
    ModelStep,
    ParameterBias,
    SignalsResult,
    UnexplainedForce,
    UnexplainedForces,
)
from dbbstation.results.inference import all_quantified, cancelling_result, finite, gains_result, quantified

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.diagnosis.drive.findings import DriveDiagnosis, DriveFinding, DriveLocation, IdentifiedValue
    from dbbstation.diagnosis.drive.held_out import DriveHeldOut


def drive_result(diagnosis: DriveDiagnosis, drawing: Callable[[object], bytes] | None = None) -> DriveResult:
    """Return everything that a diagnosis of a drive reports.

    Args:
        diagnosis: what was found.
        drawing: draws it.
    """
    rest, noise = diagnosis.rest, diagnosis.explained.settled.noise
    sources = diagnosis.explained.drive.sources
    variable = sources[diagnosis.chosen[0]].varies_with if diagnosis.chosen else rest.variable or ""
    return DriveResult(
        mismatch=diagnosis.mismatch,
        probability=diagnosis.probability,
        noise_n=noise.sigma,
        noise_correlation_samples=noise.correlation_samples,
        misfit_rms_n=diagnosis.misfit_rms_n,
        residual_rms_n=ForceErrors(
            float(np.sqrt(np.mean((diagnosis.force_n - diagnosis.base_n) ** 2))),
            float(np.sqrt(np.mean((diagnosis.force_n - diagnosis.model_n) ** 2))),
        ),
        held_back=_held_back(diagnosis),
        parameters={name: _value(number) for name, number in diagnosis.after.items()},
        parameter_shift=_biases(diagnosis),
        friction={side: all_quantified(values) for side, values in diagnosis.friction.items()},
        locations=tuple(_location(location, variable) for location in diagnosis.locations),
        sources=tuple(_cause(finding) for finding in diagnosis.findings),
        unexplained=UnexplainedForces(
            rms_n=rest.rms_n,
            probability=rest.probability,
            significant=rest.probability < SIGNIFICANT,
            variable=rest.variable,
            text=rest.text,
            effects=tuple(
                UnexplainedForce(one.text, one.variable, one.probability, one.rms_n, one.low, one.high, one.unit)
                for one in rest.effects
            ),
            locations=tuple(_location(location, rest.variable or "") for location in diagnosis.rest_locations),
        ),
        cancelling=cancelling_result(diagnosis.cancelling, "N"),
        cannot_tell=tuple(diagnosis.cannot_tell),
        held_out="not-tested" if diagnosis.held_out is None else "tested",
        held_out_rms_n=_held_out(diagnosis.held_out),
        signals=_signals(diagnosis),
        noticed=tuple(diagnosis.recordings.notes),
        table=diagnosis.table(),
        drawing=drawing,
    )


def _held_back(diagnosis: DriveDiagnosis) -> HeldBack:
    steps = diagnosis.steps
    return HeldBack(
        diagnosis.held_back_s,
        ForceErrors(steps[0].relative_force_error, steps[-1].relative_force_error),
        tuple(
            ModelStep(step.added or None, step.relative_force_error, step.fitted_error, step.parameters)
            for step in steps
        ),
        tuple(diagnosis.vague),
    )


def _value(number: IdentifiedValue) -> DriveValue:
    known = math.isfinite(number.value.uncertainty)
    return DriveValue(
        number.value.value if known else None,
        number.value.uncertainty if known else None,
        number.value.unit,
        number.identifiable,
    )


def _biases(diagnosis: DriveDiagnosis) -> tuple[ParameterBias, ...]:
    found = []
    for name, before in diagnosis.before.items():
        after = diagnosis.after[name]
        if diagnosis.chosen and before.identifiable and after.identifiable:
            alone, beside = before.value, after.value
            shift = alone.value - beside.value
            found.append(ParameterBias(name, alone.value, beside.value, shift, beside.uncertainty, alone.unit))
    return tuple(found)


def _location(location: DriveLocation, variable: str) -> ForceLocation:
    way = "forwards" if location.direction > 0 else "backwards"
    where = ", at a reversal or stop" if location.at_reversal else ""
    text = (
        f"{location.t_s[0]:.2f} to {location.t_s[1]:.2f} s, {location.position_mm[0]:.1f} to "
        f"{location.position_mm[1]:.1f} mm {way}{where}: up to {location.peak_n:+.3g} N"
        f"{f', by {variable}' if variable else ''}"
    )
    return ForceLocation(
        t_s=location.t_s,
        position_mm=location.position_mm,
        direction=way,
        at_reversal=location.at_reversal,
        variable=variable or None,
        share=location.share,
        peak_n=location.peak_n,
        text=text,
    )


def _cause(finding: DriveFinding) -> DriveCause:
    complement = finding.complement
    return DriveCause(
        name=finding.name,
        verdict=str(finding.verdict),
        ambiguous_with=tuple(finding.ambiguous_with),
        concealed=finding.concealed,
        signature_rms_n=finding.whole_n,
        unconcealed_rms_n=finding.rest_n,
        probability=finding.probability,
        gain=finding.gain,
        parameters=all_quantified(finding.parameters),
        parts=tuple(CausePart(part.label, part.t_s, all_quantified(part.parameters)) for part in finding.parts),
        at_end=tuple(finding.at_end),
        complement=None
        if complement is None
        else ComplementResult(
            quantified(complement.force_n), tuple((stretch[0], stretch[1]) for stretch in complement.t_s)
        ),
        acts=acts(finding.name).name.lower(),
        persists=finding.persists,
        gains=gains_result(finding.gains),
        text=finding.text,
    )


def _held_out(held: DriveHeldOut | None) -> HeldOutForce | None:
    return None if held is None else HeldOutForce(held.parts, held.reference_n, held.corrected_n, held.is_worse)


def _signals(diagnosis: DriveDiagnosis) -> SignalsResult:
    recordings = diagnosis.recordings
    signals, scale = recordings.signals, recordings.scale
    return SignalsResult(
        recordings=len(signals),
        samples=sum(len(one.t_s) for one in signals),
        samples_compared=len(recordings.force_n),
        rate_hz=signals[0].rate_hz,
        cutoff_hz=scale.cutoff_hz,
        shortest_wave_mm=finite(diagnosis.explained.drive.shortest_wave_mm),
        t_s=(float(signals[0].t_s[0]), float(signals[-1].t_s[-1])),
        reversals=sum(len(one.reversals) for one in signals),
        greatest_speed_mm_s=1e3 * scale.speed_m_s,
        force_rms_n=scale.force_n,
    )
