"""From a fit to its result."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from dbbstation.calibration.checks.gaps import gaps
from dbbstation.calibration.checks.missing_physics import is_missing_physics, misfit_of
from dbbstation.calibration.checks.noise_level import fine_noise_mm
from dbbstation.calibration.checks.plan_check import PlanCheck, check_plan
from dbbstation.calibration.checks.scatter import ScatterVerdict, check_scatter, seats_of
from dbbstation.calibration.checks.visibility import visibility
from dbbstation.calibration.reporting.evaluation import rms_um
from dbbstation.computing.threads import with_one_thread
from dbbstation.model.identified import known_u
from dbbstation.results.calibration import (
    CalibrationFigures,
    CalibrationResult,
    CorrelationResult,
    Covariance,
    MisfitResult,
    Observability,
    ObservabilityIndices,
    OutlierResult,
    ParameterName,
    PlanCheckResult,
    ScatterResult,
    SourceValues,
    WeakDirectionResult,
)
from dbbstation.results.of_currents import currents_result
from dbbstation.results.of_evaluation import evaluated_runs
from dbbstation.results.serialise import Quantified, plain
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from dbbstation.calibration.checks.scatter import ScatterCheck
    from dbbstation.calibration.checks.visibility import Visibility
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.layout import ParameterSet
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.calibration.reporting.evaluation import Evaluation
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.model.identified import IdentifiedModel

ELSEWHERE_IN_MODEL = frozenset({"sources", "measurement_effects", "directions_lost", "covariance"})
"""Parts of a result that the model file holds in places of their own."""


@with_one_thread
def calibration_figures(
    calibration: Calibration, evaluation: Evaluation, outliers: Sequence[Outlier] = ()
) -> CalibrationFigures:
    """Return everything that a fit says.

    Args:
        calibration: the fit.
        evaluation: of its model, with the runs that it was made from.
        outliers: what was kept from pulling it.
    """
    u = _uncertainties(calibration)
    values = [(term, _values(calibration, term, u)) for term in calibration.layout.terms]
    return CalibrationFigures(
        runs=evaluated_runs(evaluation.runs),
        nominal_rms_um=evaluation.nominal_rms_um,
        residual_rms_um=evaluation.residual_rms_um,
        residual_within_mounting_rms_um=rms_um(calibration.residual_mm),
        noise_um=1e3 * fine_noise_mm(calibration),
        misfit=_misfit(misfit_of(calibration)),
        noise_correlation_samples=calibration.noise.correlation_samples,
        parameters_identified=calibration.parameters_identified,
        directions_lost=calibration.directions_lost,
        gaps=tuple(gaps(calibration)),
        plan_check=_plan_check(check_plan(calibration)),
        directions_regularised=calibration.directions_regularised,
        parameters_prescribed=tuple(f"{source}.{name}" for source, name in calibration.prescribed),
        outliers=tuple(outlier_result(outlier) for outlier in outliers),
        scatter=tuple(_scatter(check) for check in check_scatter(seats_of(calibration))),
        observability=_observability(visibility(calibration)),
        sources=tuple(one for term, one in values if term.source.belongs_to is Owner.MACHINE),
        measurement_effects=tuple(one for term, one in values if term.source.belongs_to is not Owner.MACHINE),
        motor_currents=currents_result(calibration),
    )


def calibration_result(
    figures: CalibrationFigures,
    *,
    method: str,
    model: IdentifiedModel,
    drawing: Callable[[object], bytes],
    notes: tuple[str, ...],
) -> CalibrationResult:
    """Return the whole result of a calibration.

    Args:
        figures: of the fit.
        method: how ball positions are known.
        model: that is kept.
        drawing: draws the fit in a format.
        notes: what was noticed on the way.
    """
    own = {one.name: getattr(figures, one.name) for one in fields(CalibrationFigures)}
    return CalibrationResult(
        **{**own, "drawing": drawing, "notes": notes}, method=method, covariance=covariance_of(model), model=model
    )


def report_of(figures: CalibrationFigures, **more: Any) -> dict[str, object]:  # noqa: ANN401 - what the file takes
    """Return the numbers that a model file keeps of its fit.

    Args:
        figures: of the fit.
        more: further numbers, by name.
    """
    return {**more, **{key: value for key, value in plain(figures).items() if key not in ELSEWHERE_IN_MODEL}}


def covariance_of(identified: IdentifiedModel) -> Covariance:
    """Return the covariance of a model's parameters, rows named."""
    units = {
        (fitted.source.name, fitted.shared, parameter.name): parameter.unit
        for fitted in identified.model.sources
        for parameter in fitted.source.parameters(identified.model.machine)
    }
    rows = tuple(ParameterName(row[0], row[2], units[row]) for row in identified.covariance_rows)
    return Covariance(rows, identified.covariance)


def outlier_result(outlier: Outlier) -> OutlierResult:
    """Return one outlier."""
    return OutlierResult(
        kind=str(outlier.kind),
        test=outlier.test,
        runs=outlier.run,
        size_um=outlier.size_um,
        uncertainty_um=outlier.uncertainty_um,
        shift_um=outlier.shift_um,
        text=outlier.text,
    )


def _uncertainties(calibration: Calibration) -> NDArray[np.float64]:
    """Standard uncertainty of every column, as the model file has it, shape (k,); NaN where not known."""
    variance = np.maximum(calibration.solution.variance, 0.0)
    variance += calibration.layout.formula_variance(calibration.x)
    if calibration.prescribed:  # they define coordinates, and all parameters are known in these
        return np.sqrt(variance)
    return known_u(variance, np.sum(calibration.null_space**2, axis=0))


def _values(calibration: Calibration, term: ParameterSet, u: NDArray[np.float64]) -> SourceValues:
    numbers = zip(term.parameters, calibration.x[term.columns], u[term.columns], strict=True)
    return SourceValues(
        name=term.source.name,
        shared=term.shared or None,
        parameters={
            parameter.name: Quantified(float(value), None if np.isnan(known) else float(known), parameter.unit)
            for parameter, value, known in numbers
        },
    )


def _scatter(check: ScatterCheck) -> ScatterResult:
    told = check.finding is not ScatterVerdict.UNTOLD
    return ScatterResult(
        stated_um=check.stated_um,
        found_um=check.found_um if told else None,
        interval_um=(check.low_um, check.high_um) if told else None,
        mountings=check.mountings,
        fits=check.fits,
        finding=str(check.finding),
    )


def _plan_check(check: PlanCheck) -> PlanCheckResult:
    return PlanCheckResult(**asdict(check), left=check.left, enough=check.enough)


def _misfit(found: Misfit) -> MisfitResult:
    return MisfitResult(found.probability, 1e3 * found.rms, is_missing_physics(found))


def _observability(seen: Visibility) -> Observability:
    return Observability(
        singular_values_mm=tuple(seen.singular.tolist()),
        condition=seen.condition,
        indices=ObservabilityIndices(**asdict(seen.indices)),
        weak_directions=tuple(WeakDirectionResult(**asdict(weak)) for weak in seen.weak),
        correlations=tuple(CorrelationResult(**asdict(one)) for one in seen.correlations),
        leverage=seen.leverage,
    )
