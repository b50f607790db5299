"""A calibration and an evaluation as plain numbers: what `--json` prints, reports show and model files keep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.evaluation import Evaluation, RunFigures, rms_um
from dbbstation.inference.harmonics import LOW, smooth
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.calibration.fit import Calibration
    from dbbstation.calibration.layout import Term
    from dbbstation.trace.analysis import CircleFigures


STANDS_OUT = 4.0
LEAST_DOUBT_UM = 3.0
"""A run is doubtful that leaves four times what the usual one does, and more than a bar's noise could [µm]."""


def evaluation_summary(evaluation: Evaluation) -> dict[str, Any]:
    """Figures of every run, before under the nominal machine and after under the model [CAL Table III]."""
    return {
        "runs": [_run(run) for run in evaluation.runs],
        "nominal_rms_um": evaluation.nominal_rms_um,
        "residual_rms_um": evaluation.residual_rms_um,
    }


def calibration_summary(calibration: Calibration, evaluation: Evaluation) -> dict[str, Any]:
    """Everything that a fit says."""
    return {
        **evaluation_summary(evaluation),
        "residual_within_mounting_rms_um": rms_um(calibration.residual_mm),
        "noise_um": 1e3 * fine_noise_mm(calibration),
        "noise_correlation_samples": calibration.noise.correlation_samples,
        "parameters_identified": calibration.parameters_identified,
        "directions_lost": list(calibration.directions_lost),
        "doubtful_runs": doubtful_runs(calibration),
        "sources": [_term(calibration, term) for term in calibration.layout.terms if _is_machines(term)],
        "measurement_effects": [
            _term(calibration, term) for term in calibration.layout.terms if not _is_machines(term)
        ],
    }


def fine_noise_mm(calibration: Calibration) -> float:
    """Noise of one reading from what lies above the smooth harmonics, which no misfit of the model reaches [mm]."""
    square, count = 0.0, 0.0
    for observation, residual in zip(calibration.observations, calibration.residual_mm, strict=True):
        rough = residual - smooth(residual, np.radians(observation.raw.phi_deg))
        square += float(rough @ rough)
        count += max(len(rough) - (2 * LOW + 1), 1)
    return float(np.sqrt(square / count))


def doubtful_runs(calibration: Calibration) -> list[dict[str, Any]]:
    """Runs that leave far more than the others do, worst first: another circle's samples, a ball that moved.

    A model that lacks physics leaves more everywhere; one run that stands out by four times does not belong.
    """
    rms = np.array([1e3 * float(np.sqrt(np.mean(residual**2))) for residual in calibration.residual_mm])
    usual = float(np.median(rms))
    limit = max(STANDS_OUT * usual, LEAST_DOUBT_UM)
    found = [
        {"test": o.test, "direction": str(o.raw.circle.direction), "repeat": o.repeat, "residual_um": float(left)}
        for o, left in zip(calibration.observations, rms, strict=True)
        if left > limit
    ]
    return sorted(found, key=lambda run: -run["residual_um"])


def identified_model(
    calibration: Calibration, report: Mapping[str, Any], sessions: Mapping[str, str]
) -> IdentifiedModel:
    """Return the model to keep: values with the covariance of what belongs to the machine, and where it comes from."""
    rows = np.concatenate([np.r_[term.columns] for term in calibration.layout.terms if _is_machines(term)])
    names = calibration.layout.names
    covariance = calibration.solution.covariance[np.ix_(rows, rows)]
    return IdentifiedModel(
        model=MachineModel(calibration.layout.machine, calibration.model.sources),
        covariance_rows=tuple(names[row] for row in rows),
        covariance=(covariance + covariance.T) / 2.0,
        directions_lost=calibration.directions_lost,
        report=report,
        sessions=sessions,
    )


def _is_machines(term: Term) -> bool:
    return term.source.belongs_to is Owner.MACHINE


def _term(calibration: Calibration, term: Term) -> dict[str, Any]:
    values = calibration.x[term.columns]
    sigma = np.sqrt(np.maximum(np.diag(calibration.solution.covariance)[term.columns], 0.0))
    parameters = {
        parameter.name: {"value": float(value), "uncertainty": float(u), "unit": parameter.unit}
        for parameter, value, u in zip(term.parameters, values, sigma, strict=True)
    }
    shared = {"shared": term.shared} if term.shared else {}
    return {"name": term.source.name, **shared, "parameters": parameters}


def _run(run: RunFigures) -> dict[str, Any]:
    return {
        "test": run.test,
        "direction": run.direction,
        "repeat": run.repeat,
        "measured": _figures(run.measured),
        "before": {**_figures(run.before), "centre_deviation_from_first_um": run.before_from_first_um},
        "after": {**_figures(run.after), "centre_deviation_from_first_um": run.after_from_first_um},
    }


def _figures(figures: CircleFigures) -> dict[str, float]:
    return {
        "centre_deviation_um": figures.centre_deviation_um,
        "mean_radial_error_um": figures.mean_radial_error_um,
        "circularity_um": figures.circularity_um,
    }
