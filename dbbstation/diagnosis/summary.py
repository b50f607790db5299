"""A diagnosis as plain numbers: what `--json` prints and reports show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.calibration.evaluation import rms_um

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.diagnosis.findings import Diagnosis, Location, SourceFinding


def diagnosis_summary(diagnosis: Diagnosis, lacking: Mapping[str, str]) -> dict[str, Any]:
    """Everything a diagnosis says.

    Args:
        diagnosis: what was found.
        lacking: why further sources could not be looked at, by name.
    """
    rest = diagnosis.unexplained
    return {
        "mismatch": diagnosis.mismatch,
        "probability": diagnosis.misfit.probability,
        "noise_um": 1e3 * diagnosis.left.noise,
        "misfit_rms_um": 1e3 * diagnosis.misfit.rms,
        "residual_rms_um": {
            "before": rms_um(diagnosis.before.residual_mm),
            "after": rms_um(diagnosis.after.residual_mm),
        },
        "held_out_rms_um": {"before": diagnosis.held_out_um[0], "after": diagnosis.held_out_um[1]},
        "locations": [_location(location) for location in diagnosis.locations],
        "sources": [_source(source) for source in diagnosis.sources] + [_lacking(*item) for item in lacking.items()],
        "unexplained": {"rms_um": rest.rms_um, "strut": rest.strut, "variable": rest.variable, "text": rest.text},
        "parameter_shift": [
            {
                "parameter": shift.parameter,
                "before_um": shift.before_um,
                "after_um": shift.after_um,
                "shift_um": shift.shift_um,
                "uncertainty_um": shift.uncertainty_um,
            }
            for shift in diagnosis.shifts
        ],
        "next_test": _next_test(diagnosis),
    }


def _location(location: Location) -> dict[str, Any]:
    first, last = location.theta_deg
    by = f", by {location.variable}" if location.variable else ""
    strut = f", strut {location.strut} most" if location.strut else ""
    text = (
        f"test {location.test} {location.direction} from {first:.0f} to {last:.0f} degrees: up to "
        f"{location.peak_um:+.1f} µm{by}{strut}"
    )
    return {
        "test": location.test,
        "direction": location.direction,
        "theta_deg": [first, last],
        "strut": location.strut,
        "variable": location.variable or None,
        "share": location.share,
        "peak_um": location.peak_um,
        "text": text,
    }


def _source(source: SourceFinding) -> dict[str, Any]:
    return {
        "name": source.name,
        "verdict": str(source.verdict),
        "ambiguous_with": list(source.ambiguous_with),
        "concealed": source.concealed,
        "signature_rms_um": source.whole_um,
        "unconcealed_rms_um": source.rest_um,
        "gain": source.gain,
        "parameters": {
            name: {"value": v.value, "uncertainty": v.uncertainty, "unit": v.unit}
            for name, v in source.parameters.items()
        },
        "text": source.text,
    }


def _lacking(name: str, why: str) -> dict[str, Any]:
    return {
        "name": name,
        "verdict": "not-testable",
        "ambiguous_with": [],
        "concealed": None,
        "gain": None,
        "parameters": {},
        "text": why,
    }


def _next_test(diagnosis: Diagnosis) -> dict[str, Any] | None:
    test = diagnosis.next_test
    if test is None:
        return None
    return {
        "text": test.text,
        **test.circle,
        "source": test.source,
        "sigma_before": test.sigma_before,
        "sigma_after": test.sigma_after,
        "unit": test.unit,
    }
