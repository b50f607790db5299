"""All figures of a fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from dbbstation.calibration.checks.missing_physics import LeftByFit, left_by
from dbbstation.calibration.checks.plan_check import PlanCheck, check_plan, gaps
from dbbstation.calibration.checks.scatter import ScatterCheck, check_scatter, fine_noise_mm, seats_of
from dbbstation.calibration.checks.visibility import Observability, visibility
from dbbstation.calibration.outliers.outlier import Outlier
from dbbstation.calibration.reporting.evaluation import EvaluatedRun, rms_um
from dbbstation.calibration.reporting.motors import CurrentsFigures, motor_currents
from dbbstation.computing.threads import with_one_thread
from dbbstation.facts.serialise import Absent, Array, plain
from dbbstation.facts.value import Value
from dbbstation.model.identified import IdentifiedModel, known_u
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Owner

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.layout import ParameterSet
    from dbbstation.calibration.reporting.evaluation import Evaluation
    from dbbstation.computing.arrays import Floats


ELSEWHERE_IN_MODEL = frozenset({"sources", "measurement_effects", "directions_lost", "covariance"})
"""Parts of a result that a model file stores elsewhere."""


@dataclass(frozen=True)
class SourceValues:
    """Parameters of one error source."""

    name: str
    shared: Annotated[str | None, Absent]
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class ParameterName:
    """Name of a row of a covariance."""

    source: str
    parameter: str
    unit: str


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of the machine's identified parameters.

    Attributes:
        matrix: in products of units, shape (k, k).
    """

    rows: tuple[ParameterName, ...]
    matrix: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationFigures:
    """All figures of a fit, and its outliers.

    Attributes:
        noise_um: of a reading, from neighbouring samples.
        misfit: residual beyond noise and mountings.
        gaps: texts on the measurements that would determine lost directions.
        directions_regularised: descriptions of directions that only tolerances determine.
        parameters_prescribed: held instead of directions, as `source.parameter`.
    """

    runs: tuple[EvaluatedRun, ...]
    nominal_rms_um: float
    residual_rms_um: float
    residual_within_mounting_rms_um: float
    noise_um: float
    misfit: LeftByFit
    noise_correlation_samples: float
    parameters_identified: int
    directions_lost: tuple[str, ...]
    gaps: tuple[str, ...]
    plan_check: PlanCheck
    directions_regularised: tuple[str, ...]
    parameters_prescribed: tuple[str, ...]
    outliers: tuple[Outlier, ...]
    scatter: tuple[ScatterCheck, ...]
    observability: Observability
    sources: tuple[SourceValues, ...]
    measurement_effects: tuple[SourceValues, ...]
    motor_currents: Annotated[CurrentsFigures | None, Absent] = None

    @property
    def parameters(self) -> dict[str, Value]:
        """Return the machine's parameters as `source.parameter` with standard uncertainties."""
        return {f"{one.name}.{name}": value for one in self.sources for name, value in one.parameters.items()}


@with_one_thread
def calibration_figures(
    calibration: Calibration, evaluation: Evaluation, outliers: Sequence[Outlier] = ()
) -> CalibrationFigures:
    """Return all figures of a fit."""
    u = _uncertainties(calibration)
    values = [(term, _values(calibration, term, u)) for term in calibration.layout.terms]
    return CalibrationFigures(
        runs=evaluation.runs,
        nominal_rms_um=evaluation.nominal_rms_um,
        residual_rms_um=evaluation.residual_rms_um,
        residual_within_mounting_rms_um=rms_um(calibration.residual_mm),
        noise_um=1e3 * fine_noise_mm(calibration),
        misfit=left_by(calibration),
        noise_correlation_samples=calibration.noise.correlation_samples,
        parameters_identified=calibration.parameters_identified,
        directions_lost=calibration.directions_lost,
        gaps=tuple(gaps(calibration)),
        plan_check=check_plan(calibration),
        directions_regularised=calibration.directions_regularised,
        parameters_prescribed=tuple(f"{source}.{name}" for source, name in calibration.prescribed),
        outliers=tuple(outliers),
        scatter=tuple(check_scatter(seats_of(calibration))),
        observability=visibility(calibration),
        sources=tuple(one for term, one in values if term.source.belongs_to is Owner.MACHINE),
        measurement_effects=tuple(one for term, one in values if term.source.belongs_to is not Owner.MACHINE),
        motor_currents=motor_currents(calibration),
    )


def report_of(figures: CalibrationFigures, **more: Any) -> dict[str, object]:  # noqa: ANN401 - types of the model file
    """Return the figures that a model file stores."""
    return {**more, **{key: value for key, value in plain(figures).items() if key not in ELSEWHERE_IN_MODEL}}


def covariance_of(identified: IdentifiedModel) -> Covariance:
    """Return a model's covariance with named rows."""
    units = {
        (fitted.source.name, fitted.shared, parameter.name): parameter.unit
        for fitted in identified.model.sources
        for parameter in fitted.source.parameters(identified.model.machine)
    }
    rows = tuple(ParameterName(row[0], row[2], units[row]) for row in identified.covariance_rows)
    return Covariance(rows, identified.covariance)


def _uncertainties(calibration: Calibration) -> Floats:
    variance = np.maximum(calibration.solution.variance, 0.0)
    variance += calibration.layout.formula_variance(calibration.x)
    if calibration.prescribed:  # prescribed parameters define coordinates, in which all parameters are known
        return np.sqrt(variance)
    return known_u(variance, np.sum(calibration.null_space**2, axis=0))


def _values(calibration: Calibration, term: ParameterSet, u: Floats) -> SourceValues:
    numbers = zip(term.parameters, calibration.x[term.columns], u[term.columns], strict=True)
    return SourceValues(
        name=term.source.name,
        shared=term.shared or None,
        parameters={
            parameter.name: Value(float(value), float(known), parameter.unit) for parameter, value, known in numbers
        },
    )


def identified_model(
    calibration: Calibration, report: Mapping[str, Any], sessions: Mapping[str, str]
) -> IdentifiedModel:
    """Return the model to store, with the covariance of machine parameters and the origin of the data."""
    machines = [term for term in calibration.layout.terms if term.source.belongs_to is Owner.MACHINE]
    rows = np.concatenate([np.r_[term.columns] for term in machines])
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
