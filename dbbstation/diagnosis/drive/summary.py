"""The diagnosis of a drive as plain numbers: what `--json` prints."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.inference.left_over import SIGNIFICANT

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.diagnosis.drive.findings import (
        DriveDiagnosis,
        DriveFinding,
        DriveLocation,
        DriveStep,
        IdentifiedValue,
    )
    from dbbstation.diagnosis.drive.held_out import DriveHeldOut
    from dbbstation.inference.verdict import Value


def drive_summary(diagnosis: DriveDiagnosis) -> dict[str, Any]:
    """Everything a diagnosis of a drive says."""
    recordings, rest = diagnosis.recordings, diagnosis.rest
    noise, sources = diagnosis.explained.settled.noise, diagnosis.explained.drive.sources
    variable = sources[diagnosis.chosen[0]].varies_with if diagnosis.chosen else rest.variable or ""
    return {
        "mismatch": diagnosis.mismatch,
        "probability": diagnosis.probability,
        "noise_n": noise.sigma,
        "noise_correlation_samples": noise.correlation_samples,
        "misfit_rms_n": diagnosis.misfit_rms_n,
        "residual_rms_n": {
            "before": float(np.sqrt(np.mean((diagnosis.force_n - diagnosis.base_n) ** 2))),
            "after": float(np.sqrt(np.mean((diagnosis.force_n - diagnosis.model_n) ** 2))),
        },
        "held_back": {
            "t_s": list(diagnosis.held_back_s),
            "relative_force_error": {
                "before": diagnosis.steps[0].relative_force_error,
                "after": diagnosis.steps[-1].relative_force_error,
            },
            "steps": [_step(step) for step in diagnosis.steps],
            "not_in_model": list(diagnosis.vague),
        },
        "parameters": {name: _number(number) for name, number in diagnosis.after.items()},
        "parameter_shift": [
            {
                "parameter": name,
                "before": before.value.value,
                "after": diagnosis.after[name].value.value,
                "shift": before.value.value - diagnosis.after[name].value.value,
                "uncertainty": diagnosis.after[name].value.uncertainty,
                "unit": before.value.unit,
            }
            for name, before in diagnosis.before.items()
            if diagnosis.chosen and before.identifiable and diagnosis.after[name].identifiable
        ],
        "friction": {side: _values(values) for side, values in diagnosis.friction.items()},
        "locations": [_location(location, variable) for location in diagnosis.locations],
        "sources": [_source(finding) for finding in diagnosis.findings],
        "unexplained": {
            "rms_n": rest.rms_n,
            "probability": rest.probability,
            "significant": rest.probability < SIGNIFICANT,
            "variable": rest.variable,
            "text": rest.text,
            "effects": [
                {
                    "text": effect.text,
                    "variable": effect.variable,
                    "probability": effect.probability,
                    "rms_n": effect.rms_n,
                    "from": effect.low,
                    "to": effect.high,
                    "unit": effect.unit,
                }
                for effect in rest.effects
            ],
            "locations": [_location(location, rest.variable or "") for location in diagnosis.rest_locations],
        },
        "cannot_tell": list(diagnosis.cannot_tell),
        "held_out": "not-tested" if diagnosis.held_out is None else "tested",
        "held_out_rms_n": _held_out(diagnosis.held_out),
        "signals": {
            "recordings": len(recordings.signals),
            "samples": sum(len(one.t_s) for one in recordings.signals),
            "samples_compared": len(recordings.force_n),
            "rate_hz": recordings.signals[0].rate_hz,
            "cutoff_hz": recordings.scale.cutoff_hz,
            "shortest_wave_mm": _finite(diagnosis.explained.drive.shortest_wave_mm),
            "t_s": [float(recordings.signals[0].t_s[0]), float(recordings.signals[-1].t_s[-1])],
            "reversals": sum(len(one.reversals) for one in recordings.signals),
            "greatest_speed_mm_s": 1e3 * recordings.scale.speed_m_s,
            "force_rms_n": recordings.scale.force_n,
        },
        "notes": recordings.notes,
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _number(number: IdentifiedValue) -> dict[str, Any]:
    known = math.isfinite(number.value.uncertainty)
    return {
        "value": number.value.value if known else None,
        "uncertainty": number.value.uncertainty if known else None,
        "unit": number.value.unit,
        "identifiable": number.identifiable,
    }


def _values(values: Mapping[str, Value]) -> dict[str, Any]:
    return {
        name: {"value": v.value, "uncertainty": _finite(v.uncertainty), "unit": v.unit} for name, v in values.items()
    }


def _step(step: DriveStep) -> dict[str, Any]:
    return {
        "added": step.added or None,
        "relative_force_error": step.relative_force_error,
        "fitted_error": step.fitted_error,
        "parameters": step.parameters,
    }


def _location(location: DriveLocation, variable: str) -> dict[str, Any]:
    way = "forwards" if location.direction > 0 else "backwards"
    where = ", at a reversal or stop" if location.at_reversal else ""
    text = (
        f"{location.t_s[0]:.2f} to {location.t_s[1]:.2f} s, {location.position_mm[0]:.1f} to "
        f"{location.position_mm[1]:.1f} mm {way}{where}: up to {location.peak_n:+.3g} N"
        f"{f', by {variable}' if variable else ''}"
    )
    return {
        "t_s": list(location.t_s),
        "position_mm": list(location.position_mm),
        "direction": way,
        "at_reversal": location.at_reversal,
        "variable": variable or None,
        "share": location.share,
        "peak_n": location.peak_n,
        "text": text,
    }


def _source(finding: DriveFinding) -> dict[str, Any]:
    return {
        "name": finding.name,
        "verdict": str(finding.verdict),
        "ambiguous_with": list(finding.ambiguous_with),
        "concealed": finding.concealed,
        "signature_rms_n": finding.whole_n,
        "unconcealed_rms_n": finding.rest_n,
        "probability": finding.probability,
        "gain": finding.gain,
        "parameters": _values(finding.parameters),
        "parts": [
            {
                "label": part.label,
                "t_s": None if part.t_s is None else list(part.t_s),
                "parameters": _values(part.parameters),
            }
            for part in finding.parts
        ],
        "at_end": list(finding.at_end),
        "complement": None
        if finding.complement is None
        else {
            "force_n": _values({"force_n": finding.complement.force_n})["force_n"],
            "t_s": [list(stretch) for stretch in finding.complement.t_s],
        },
        "gains": None
        if finding.gains is None
        else {"with_gain": finding.gains.with_gain, "predicts": finding.gains.predicts},
        "text": finding.text,
    }


def _held_out(held: DriveHeldOut | None) -> dict[str, Any] | None:
    if held is None:
        return None
    return {
        "parts": held.parts,
        "reference": held.reference_n,
        "corrected": held.corrected_n,
        "worse": held.is_worse,
    }
