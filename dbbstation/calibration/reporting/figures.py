"""All figures of a fit, of motor currents too."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from dbbstation.calibration.checks.scatter import (
    LeftByFit,
    ScatterCheck,
    check_scatter,
    fine_noise_mm,
    left_by,
    seats_of,
)
from dbbstation.calibration.checks.visibility import Observability, PlanCheck, check_plan, gaps, visibility
from dbbstation.calibration.outliers.outlier import Outlier
from dbbstation.calibration.reporting.evaluation import EvaluatedRun, rms_um
from dbbstation.computing.threads import with_one_thread
from dbbstation.facts.serialise import Absent, Array, plain
from dbbstation.facts.value import Value
from dbbstation.machine.geometry import STRUTS
from dbbstation.machine.statics import GRAVITY_M_S2
from dbbstation.model.identified import IdentifiedModel, known_u
from dbbstation.sources.causes.drive_friction import PER_MOTOR, of_motor
from dbbstation.sources.contract import Owner
from dbbstation.sources.laws.weights import platform_masses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.currents import MotorFindings
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.layout import ParameterSet
    from dbbstation.calibration.reporting.evaluation import Evaluation
    from dbbstation.computing.arrays import Floats


N_PER_KN = 1e3
MM_PER_M = 1e3


@dataclass(frozen=True)
class Motor:
    """One motor; None for undetermined numbers.

    Attributes:
        motor: 1 to 6.
        force_per_current: of the strut [N/A].
        torque_per_current: at the screw [Nm/A]; None if its lead is unknown.
    """

    motor: int
    gain_a_kn: Value | None
    coulomb_n: Value | None
    viscous_ns_mm: Value | None
    load_share_n_kn: Value | None
    asymmetry_n: Value | None
    force_per_current: Value | None
    torque_per_current: Value | None
    residual_a: float | None
    noise_a: float | None
    noise_correlation_samples: float | None
    samples: int


@dataclass(frozen=True)
class CurrentsFigures:
    """Results of all motors.

    Attributes:
        weight_taken_as_known_n: of the platform; all forces are relative to it.
        centre_of_gravity: by coordinate and channel, `circles`, `currents`, `both` [mm]; None if undetermined.
    """

    weight_taken_as_known_n: float
    motors: tuple[Motor, ...]
    centre_of_gravity: Mapping[str, Mapping[str, Value | None]]
    notes: tuple[str, ...]


def motor_currents(calibration: Calibration) -> CurrentsFigures | None:
    """Return gain, friction, noise and residual of motors, and the centre of gravity by channel.

    Without fitted currents the result is None; undetermined numbers are None.
    """
    found = calibration.currents
    if found is None:
        return None
    weight_n = platform_masses("drive-friction", calibration.layout.machine).platform_kg * GRAVITY_M_S2
    return CurrentsFigures(
        weight_taken_as_known_n=weight_n,
        motors=tuple(_motor(calibration, found, motor) for motor in range(STRUTS)),
        centre_of_gravity=_centre_of_gravity(calibration, found),
        notes=tuple(found.notes),
    )


def _fitted(calibration: Calibration, source: str) -> dict[str, tuple[float, float]]:
    sigma = np.sqrt(np.maximum(calibration.solution.variance, 0.0))
    numbers = zip(calibration.layout.names, calibration.x, sigma, strict=True)
    return {name: (float(value), float(u)) for (of, _, name), value, u in numbers if of == source}


def _motor(calibration: Calibration, found: MotorFindings, motor: int) -> Motor:
    term = next(term for term in calibration.layout.terms if term.source.of_currents)
    numbers = _fitted(calibration, term.source.name)
    units = {p.name: p.unit for p in term.parameters}
    names = {kind: of_motor(motor + 1, kind) for kind in PER_MOTOR}
    told = {kind: None if name in found.held else Value(*numbers[name], units[name]) for kind, name in names.items()}
    gain, gain_u = numbers[names[PER_MOTOR[0]]]
    force = torque = None
    if told[PER_MOTOR[0]] is not None and gain != 0.0:
        force = Value(N_PER_KN / gain, N_PER_KN * gain_u / gain**2, "N/A")
        lead = calibration.layout.machine.screw_lead_mm
        turning = None if lead is None else lead / (2.0 * math.pi * MM_PER_M)
        if turning:
            torque = Value(force.value * turning, force.uncertainty * turning, "Nm/A")
    noise = found.noise[motor]
    return Motor(
        motor=motor + 1,
        **told,
        force_per_current=force,
        torque_per_current=torque,
        residual_a=None if noise is None else found.residual_a[motor],
        noise_a=None if noise is None else found.fine_a[motor],
        noise_correlation_samples=None if noise is None else noise.correlation_samples,
        samples=found.samples[motor],
    )


def _centre_of_gravity(calibration: Calibration, found: MotorFindings) -> dict[str, dict[str, Value | None]]:
    together = _fitted(calibration, "cog-shift")
    shifts: dict[str, dict[str, Value | None]] = {}
    for name in next(iter(found.alone.values()), {}):
        alone = {channel: by_name[name] for channel, by_name in found.alone.items()}
        shifts[name] = {
            **{channel: None if number is None else Value(*number, "mm") for channel, number in alone.items()},
            "both": Value(*together[name], "mm"),
        }
    return shifts


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
        model=calibration.model,
        covariance_rows=tuple(names[row] for row in rows),
        covariance=(covariance + covariance.T) / 2.0,
        directions_lost=calibration.directions_lost,
        report=report,
        sessions=sessions,
        null_space=calibration.null_space[:, rows],
        formula_variance=of_formulas,
    )
