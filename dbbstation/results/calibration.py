"""What a calibration found: the result of `calibrate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from dbbstation.model.identified import IdentifiedModel
from dbbstation.results.currents import CurrentsResult
from dbbstation.results.evaluation import EvaluatedRun, rows_of
from dbbstation.results.frame import Framed
from dbbstation.results.serialise import Absent, Array, AsItIs, Kept, Quantified


@dataclass(frozen=True)
class MisfitResult:
    """The residual beyond noise and mountings, by an F test of low harmonics.

    Attributes:
        probability: of that much by chance.
        rms_um: its size [µm].
        missing_physics: whether chance does not explain it.
    """

    probability: float
    rms_um: float
    missing_physics: bool


@dataclass(frozen=True)
class PlanCheckResult:
    """Whether the tests are enough to check the plan that they were run by.

    Attributes:
        tests: number of tests.
        determined: directions that single tests determine, summed over the tests.
        identified: directions that all tests together determine.
        of_one_test: directions that the test that shows most determines.
        left: degrees of freedom that are left to check the plan.
        enough: whether the tests can show a wrong plan.
    """

    tests: int
    determined: int
    identified: int
    of_one_test: int
    left: int
    enough: bool


@dataclass(frozen=True)
class OutlierResult:
    """An outlier that was kept out of the fit.

    Attributes:
        kind: what it is.
        test: name of the test.
        runs: label of the run, or of the runs of one mounting.
        size_um: how far off [µm].
        uncertainty_um: its standard uncertainty; None of a run [µm].
        shift_um: where a ball stands, machine axes; None of a run [µm].
        text: in words.
    """

    kind: str
    test: str
    runs: str
    size_um: float
    uncertainty_um: float | None
    shift_um: tuple[float, float, float] | None
    text: str


@dataclass(frozen=True)
class ScatterResult:
    """Whether balls scatter as stated.

    Attributes:
        stated_um: standard deviation per axis, as plan and session state it [µm].
        found_um: what they scatter by; None where the runs cannot tell [µm].
        interval_um: 95 % interval of that; None likewise [µm].
        mountings: how many.
        fits: whether the stated size lies in it; None where the runs cannot tell.
        finding: where the stated size lies.
    """

    stated_um: float
    found_um: float | None
    interval_um: tuple[float, float] | None
    mountings: int
    fits: bool | None
    finding: str


@dataclass(frozen=True)
class ObservabilityIndices:
    """O1 to O5 of scaled parameters [Sun and Hollerbach, ICRA 2008, eqs 3 to 7]; all grow with what is seen."""

    o1: float
    o2: float
    o3: float
    o4: float
    o5: float


@dataclass(frozen=True)
class WeakDirectionResult:
    """A direction that the runs see least of those they see.

    Attributes:
        text: in words.
        uncertainty: how far the parameter that it moves most may be off along it, one standard deviation.
        unit: of that.
    """

    text: str
    uncertainty: float
    unit: str


@dataclass(frozen=True)
class CorrelationResult:
    """Two parameters that the runs hardly tell apart.

    Attributes:
        first: source and name.
        second: source and name.
        value: of their correlation.
    """

    first: str
    second: str
    value: float


@dataclass(frozen=True)
class Observability:
    """What the circles see of the machine's parameters.

    Attributes:
        singular_values_mm: of the readings' sensitivity to parameters in units of their usual size, falling [mm].
        condition: greatest over least of them.
        indices: O1 to O5 of them.
        weak_directions: the weakest first.
        correlations: the largest first.
        leverage: by test, how many parameters' worth of what is known it brings.
    """

    singular_values_mm: tuple[float, ...]
    condition: float
    indices: ObservabilityIndices
    weak_directions: tuple[WeakDirectionResult, ...]
    correlations: tuple[CorrelationResult, ...]
    leverage: Mapping[str, float]


@dataclass(frozen=True)
class SourceValues:
    """Parameters of one error source.

    Attributes:
        name: of the source.
        shared: what has these values, such as a session or mounting; None of the machine.
        parameters: by name.
    """

    name: str
    shared: Annotated[str | None, Absent]
    parameters: Mapping[str, Quantified]


@dataclass(frozen=True)
class ParameterName:
    """Name of a row of a covariance.

    Attributes:
        source: error source that it belongs to.
        parameter: its name there, with its unit.
        unit: of its value.
    """

    source: str
    parameter: str
    unit: str


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of the machine's parameters, as identified.

    Along `directions_lost` it has no variance: nothing was identified there, and values stay nominal.

    Attributes:
        rows: name of each row and column.
        matrix: in the products of their units, shape (k, k).
    """

    rows: tuple[ParameterName, ...]
    matrix: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationFigures(Framed):
    """Everything that a fit says, and what was kept from pulling it.

    Attributes:
        runs: figures of every run, under the nominal machine and under the model.
        nominal_rms_um: measured less predicted length under the nominal machine [µm].
        residual_rms_um: the same under the model's machine [µm].
        residual_within_mounting_rms_um: the same after each mounting's shift of the ball [µm].
        noise_um: of one reading, from differences of neighbours [µm].
        misfit: the residual beyond noise and mountings.
        noise_correlation_samples: samples after which noise is new.
        parameters_identified: how many.
        directions_lost: what the tests cannot identify, in words.
        gaps: what is known of these all the same, in words.
        plan_check: whether the tests are enough to check the plan.
        directions_regularised: what only tolerances of the machine file tell, in words.
        parameters_prescribed: held at nominal in place of directions, as `source.parameter`.
        outliers: kept out of the fit.
        scatter: whether balls scatter as stated.
        observability: what the circles see.
        sources: values of the machine's parameters.
        measurement_effects: values of what belongs to session, mounting or instrument.
        motor_currents: what these say; None for circles alone.
    """

    runs: tuple[EvaluatedRun, ...]
    nominal_rms_um: float
    residual_rms_um: float
    residual_within_mounting_rms_um: float
    noise_um: float
    misfit: MisfitResult
    noise_correlation_samples: float
    parameters_identified: int
    directions_lost: tuple[str, ...]
    gaps: tuple[str, ...]
    plan_check: PlanCheckResult
    directions_regularised: tuple[str, ...]
    parameters_prescribed: tuple[str, ...]
    outliers: tuple[OutlierResult, ...]
    scatter: tuple[ScatterResult, ...]
    observability: Observability
    sources: tuple[SourceValues, ...]
    measurement_effects: tuple[SourceValues, ...]
    motor_currents: Annotated[CurrentsResult | None, Absent] = None

    @property
    def parameters(self) -> dict[str, Quantified]:
        """The machine's parameters as `source.parameter`, with their standard uncertainties."""
        return {f"{one.name}.{name}": value for one in self.sources for name, value in one.parameters.items()}

    def rows(self) -> list[dict[str, object]]:
        """The machine's parameters, one row for each; `u` is the standard uncertainty."""
        return [
            {"source": one.name, "parameter": name, "value": each.value, "u": each.uncertainty, "unit": each.unit}
            for one in self.sources
            for name, each in one.parameters.items()
        ]

    def run_rows(self) -> list[dict[str, object]]:
        """Figures of the runs before and after, one row for each."""
        return rows_of(self.runs)


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibrationResult(CalibrationFigures):
    """What a calibration found.

    Attributes:
        method: how ball positions are known: `jig`, `conv-a` or `conv-b`.
        covariance: of the machine's parameters.
        model: to predict and compensate with, or to write to a file.
    """

    method: str
    covariance: Covariance
    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)
