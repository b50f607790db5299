"""A calibration and an evaluation as plain numbers: what `--json` prints, reports show and model files keep."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.checks.gaps import gaps
from dbbstation.calibration.checks.missing_physics import is_missing_physics, misfit_of
from dbbstation.calibration.checks.noise_level import fine_noise_mm
from dbbstation.calibration.checks.plan_check import PlanCheck, check_plan
from dbbstation.calibration.checks.scatter import ScatterVerdict, check_scatter, seats_of
from dbbstation.calibration.checks.visibility import visibility
from dbbstation.calibration.reporting.currents import currents_summary
from dbbstation.calibration.reporting.evaluation import Evaluation, RunFigures, rms_um
from dbbstation.model.identified import IdentifiedModel, known_u
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Owner
from dbbstation.threads import with_one_thread

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.checks.scatter import ScatterCheck
    from dbbstation.calibration.checks.visibility import Visibility
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.layout import Term
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.trace.analysis import CircleFigures


def evaluation_summary(evaluation: Evaluation) -> dict[str, Any]:
    """Figures of every run, before under the nominal machine and after under the model [CAL Table III]."""
    return {
        "runs": [_run(run) for run in evaluation.runs],
        "nominal_rms_um": evaluation.nominal_rms_um,
        "residual_rms_um": evaluation.residual_rms_um,
    }


@with_one_thread
def calibration_summary(
    calibration: Calibration, evaluation: Evaluation, outliers: Sequence[Outlier] = ()
) -> dict[str, Any]:
    """Everything that a fit says, and what was kept from pulling it."""
    u = _uncertainties(calibration)
    return {
        **evaluation_summary(evaluation),
        "residual_within_mounting_rms_um": rms_um(calibration.residual_mm),
        "noise_um": 1e3 * fine_noise_mm(calibration),
        "misfit": _misfit(misfit_of(calibration)),
        "noise_correlation_samples": calibration.noise.correlation_samples,
        "parameters_identified": calibration.parameters_identified,
        "directions_lost": list(calibration.directions_lost),
        "gaps": list(gaps(calibration)),
        "plan_check": _plan_check(check_plan(calibration)),
        "directions_regularised": list(calibration.directions_regularised),
        "parameters_prescribed": [f"{source}.{name}" for source, name in calibration.prescribed],
        "outliers": [outlier_summary(outlier) for outlier in outliers],
        "scatter": [_scatter(check) for check in check_scatter(seats_of(calibration))],
        "observability": _visibility(visibility(calibration)),
        "sources": [_term(calibration, term, u) for term in calibration.layout.terms if _is_machines(term)],
        "measurement_effects": [
            _term(calibration, term, u) for term in calibration.layout.terms if not _is_machines(term)
        ],
        **currents_summary(calibration),
    }


def identified_model(
    calibration: Calibration, report: Mapping[str, Any], sessions: Mapping[str, str]
) -> IdentifiedModel:
    """Return the model to keep: values with the covariance of what belongs to the machine, and where it comes from."""
    rows = np.concatenate([np.r_[term.columns] for term in calibration.layout.terms if _is_machines(term)])
    names = calibration.layout.names
    of_formulas = calibration.layout.formula_variance(calibration.x)[rows]
    covariance = calibration.solution.covariance[np.ix_(rows, rows)] + np.diag(of_formulas)
    return IdentifiedModel(
        model=MachineModel(calibration.layout.machine, calibration.model.sources),
        covariance_rows=tuple(names[row] for row in rows),
        covariance=(covariance + covariance.T) / 2.0,
        directions_lost=calibration.directions_lost,
        report=report,
        sessions=sessions,
        null_space=calibration.null_space[:, rows],
        formula_variance=of_formulas,
    )


def _is_machines(term: Term) -> bool:
    return term.source.belongs_to is Owner.MACHINE


def _uncertainties(calibration: Calibration) -> NDArray[np.float64]:
    """Standard uncertainty of every column, as the model file has it, shape (k,); NaN where not known."""
    variance = np.maximum(calibration.solution.variance, 0.0)
    variance += calibration.layout.formula_variance(calibration.x)
    if calibration.prescribed:  # they define coordinates, and all parameters are known in these
        return np.sqrt(variance)
    return known_u(variance, np.sum(calibration.null_space**2, axis=0))


def _term(calibration: Calibration, term: Term, u: NDArray[np.float64]) -> dict[str, Any]:
    parameters = {
        parameter.name: {
            "value": float(value),
            "uncertainty": None if np.isnan(known) else float(known),
            "unit": parameter.unit,
        }
        for parameter, value, known in zip(term.parameters, calibration.x[term.columns], u[term.columns], strict=True)
    }
    shared = {"shared": term.shared} if term.shared else {}
    return {"name": term.source.name, **shared, "parameters": parameters}


def outlier_summary(outlier: Outlier) -> dict[str, Any]:
    """One thing that does not belong, as plain numbers."""
    shift = None if outlier.shift_um is None else list(outlier.shift_um)
    return {
        "kind": str(outlier.kind),
        "test": outlier.test,
        "runs": outlier.run,
        "size_um": outlier.size_um,
        "uncertainty_um": outlier.uncertainty_um,
        "shift_um": shift,
        "text": outlier.text,
    }


def _scatter(check: ScatterCheck) -> dict[str, Any]:
    told = check.finding is not ScatterVerdict.UNTOLD
    return {
        "stated_um": check.stated_um,
        "found_um": check.found_um if told else None,
        "interval_um": [check.low_um, check.high_um] if told else None,
        "mountings": check.mountings,
        "fits": check.fits,
        "finding": str(check.finding),
    }


def _plan_check(check: PlanCheck) -> dict[str, Any]:
    return {**asdict(check), "left": check.left, "enough": check.enough}


def _misfit(found: Misfit) -> dict[str, Any]:
    return {
        "probability": found.probability,
        "rms_um": 1e3 * found.rms,
        "missing_physics": is_missing_physics(found),
    }


def _visibility(seen: Visibility) -> dict[str, Any]:
    return {
        "singular_values_mm": seen.singular.tolist(),
        "condition": seen.condition,
        "indices": asdict(seen.indices),
        "weak_directions": [asdict(weak) for weak in seen.weak],
        "correlations": [asdict(correlation) for correlation in seen.correlations],
        "leverage": seen.leverage,
    }


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
