"""A diagnosis as plain numbers: what `--json` prints and reports show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dbbstation.calibration.outliers.outlier import SOURCE_OF, Kind
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.calibration.reporting.summary import outlier_summary
from dbbstation.inference.verdict import Acts, Verdict
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.findings import Diagnosis, Location, NextTest, SourceFinding


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
        "held_out_rms_um": {when: 1e3 * of.rms for when, of in zip(WHEN, diagnosis.held_out, strict=True)},
        "held_out_normalised": {when: of.normalised for when, of in zip(WHEN, diagnosis.held_out, strict=True)},
        "held_out": "not-tested" if diagnosis.chosen_anew is None else "tested",
        "held_out_worse": None if diagnosis.chosen_anew is None else diagnosis.chosen_anew.is_worse,
        "circularity_um": _circularity(diagnosis),
        "workspace": _workspace(diagnosis),
        "outliers": [outlier_summary(outlier) for outlier in diagnosis.outliers],
        "locations": [_location(location) for location in diagnosis.locations],
        "sources": [
            *_seats(diagnosis),
            *(_source(source) for source in diagnosis.sources),
            *(_lacking(*item) for item in lacking.items()),
        ],
        "unexplained": {
            "rms_um": rest.rms_um,
            "strut": rest.strut,
            "variable": rest.variable,
            "text": rest.text,
            "curve": None if rest.curve is None else rest.curve.plain(),
        },
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
        "second_start_agrees": diagnosis.second_start_agrees,
        "next_test": _next_test(diagnosis.next_tests[0]) if diagnosis.next_tests else None,
        "further_tests": [_next_test(t) for t in diagnosis.next_tests[1:]],
    }


WHEN = ("before", "after")


def _circularity(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Circularity that is left of every run, under the kinematic and the joint model."""
    return [
        {
            "test": run.test,
            "direction": str(run.raw.circle.direction),
            "repeat": run.repeat,
            **{
                when: figures(run.raw, run.raw.circle.bar_mm + left).circularity_um
                for when, left in zip(WHEN, both, strict=True)
            },
        }
        for run, *both in zip(
            diagnosis.before.observations, diagnosis.before.residual_mm, diagnosis.after.residual_mm, strict=True
        )
    ]


def _workspace(diagnosis: Diagnosis) -> dict[str, Any] | None:
    found = diagnosis.workspace
    if found is None:
        return None
    return {
        "error_rms_um": found.rms_um,
        "error_greatest_um": found.greatest_um,
        "at_pose": list(found.at_pose),
        "uncertainty_rms_um": found.uncertainty_um,
        "common_shift_um": list(found.shift_um),
        "error_with_shift_rms_um": found.with_shift_rms_um,
        "uncertainty_with_shift_rms_um": found.with_shift_uncertainty_um,
    }


def _seats(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Balls and bars that are not what they should be, under the names of the sources that say so."""
    entries = []
    for name in dict.fromkeys(SOURCE_OF.values()):
        told = [outlier for outlier in diagnosis.outliers if SOURCE_OF.get(outlier.kind) == name]
        if told:
            alike = sorted({other for outlier in told for other in outlier.alike})
            alike += [] if all(outlier.sure for outlier in told) else [other for other in BALLS if other != name]
            entries.append(
                {
                    **_lacking(name, "; ".join(outlier.text for outlier in told)),
                    "verdict": str(Verdict.AMBIGUOUS if alike else Verdict.HAPPENED),
                    "acts": Acts.ONCE.name.lower(),
                    "ambiguous_with": alike,
                    "parameters": {
                        _of(outlier): {"value": outlier.size_um, "uncertainty": outlier.uncertainty_um, "unit": "µm"}
                        for outlier in told
                        if outlier.uncertainty_um is not None
                    },
                }
            )
    return entries


def _of(outlier: Outlier) -> str:
    return f"offset ({outlier.test})" if outlier.kind is Kind.BAR else f"distance ({outlier.run})"


BALLS = ("mounting", "ball-coordinate")
"""What cannot be told apart where a ball was put up once only."""


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
        "stability": source.stability,
        "probability": source.probability,
        "class": list(source.equivalent),
        "log_evidence": source.gain,
        "acts": source.acts.name.lower(),
        "persists": source.persists,
        "sigmas": source.sigmas,
        "gains": None if source.gains is None else source.gains.plain(),
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
        "stability": None,
        "probability": None,
        "class": [],
        "log_evidence": None,
        "acts": None,
        "persists": False,
        "sigmas": None,
        "gains": None,
        "parameters": {},
        "text": why,
    }


def _next_test(test: NextTest) -> dict[str, Any]:
    return {
        "text": test.text,
        **test.circle,
        "source": test.source,
        "sigma_before": test.sigma_before,
        "sigma_after": test.sigma_after,
        "unit": test.unit,
    }
