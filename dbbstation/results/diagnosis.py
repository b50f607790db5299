"""The result of `diagnose`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, computed_field

from dbbstation.calibration.outliers.outlier import Outlier
from dbbstation.facts.by_name import ByName
from dbbstation.facts.run import OfRun
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import Value
from dbbstation.files.formats.model import write_model
from dbbstation.files.provenance import Provenance
from dbbstation.inference.cancelling import Cancelling
from dbbstation.inference.levels import Levels
from dbbstation.inference.limit_reached import LimitReached
from dbbstation.inference.verdict import Gains
from dbbstation.model.identified import IdentifiedModel
from dbbstation.results.effects import CauseContribution
from dbbstation.results.frame import Framed
from dbbstation.results.levels_text import level_sentences, short_sentences


@dataclass(frozen=True)
class BeforeAfter:
    """A figure under kinematic calibration (before) and joint model (after)."""

    before: float
    after: float


@dataclass(frozen=True)
class CircularityLeft(OfRun):
    """Residual circularity of one run [µm]."""

    before: float
    after: float


@dataclass(frozen=True)
class WorkspaceGain:
    """Distance of kinematic calibration and joint model over the workspace.

    Attributes:
        uncertainty_rms_um: standard uncertainty of the joint model; None if unknown.
        common_shift_um: mean of X, Y and Z.
    """

    error_rms_um: float
    error_greatest_um: float
    at_pose: tuple[float, ...]
    uncertainty_rms_um: float | None
    common_shift_um: tuple[float, ...]
    error_with_shift_rms_um: float
    uncertainty_with_shift_rms_um: float | None


@dataclass(frozen=True)
class MisfitLocation:
    """Where the kinematic misfit is large.

    Attributes:
        strut: 1 to 6; None if none stands out.
    """

    test: str
    direction: str
    theta_deg: tuple[float, float]
    strut: int | None
    variable: str | None
    share: float
    peak_um: float
    text: str


@dataclass(frozen=True, kw_only=True)
class CauseResult:
    """What was found of one cause.

    Attributes:
        verdict: see docs/verdicts.md.
        ambiguous_with: causes of similar probability.
        concealed: R² of its effect on kinematic parameters.
        unconcealed_rms_um: part beyond kinematic parameters.
        equivalent: causes indistinguishable by these recordings; `class` in JSON.
        log_evidence: the gain under its older name.
        persists: a single event, confirmed by held-out tests.
    """

    name: str
    verdict: str
    ambiguous_with: tuple[str, ...] = ()
    concealed: float | None = None
    signature_rms_um: Annotated[float | None, Absent] = None
    unconcealed_rms_um: Annotated[float | None, Absent] = None
    gain: float | None = None
    stability: float | None = None
    probability: float | None = None
    equivalent: Annotated[tuple[str, ...], Field(serialization_alias="class")] = ()
    log_evidence: float | None = None
    acts: str | None = None
    persists: bool = False
    sigmas: float | None = None
    gains: Gains | None = None
    parameters: Mapping[str, Value] = field(default_factory=dict)
    text: str


@dataclass(frozen=True)
class CurveFollows:
    """The variable of an unmodelled effect.

    Attributes:
        kind: such as `wave`; empty for the usual one.
    """

    variable: str
    kind: str
    moves: str


@dataclass(frozen=True)
class UnexplainedPoint:
    """One point of a curve."""

    at: float
    value_um: float
    uncertainty_um: float


@dataclass(frozen=True, kw_only=True)
class UnexplainedCurve:
    """An unmodelled effect as a curve.

    Attributes:
        strut: 1 to 6; None for all struts or none.
        period: of a wave, in the variable's unit; else None.
        direction: of the strongest motion; empty for a scalar.
        convention: part removed since fitted parameters can make it; may be empty.
        readings_um: rms effect on readings.
        unconcealed_um: part beyond fitted machine parameters.
    """

    variable: str
    period_mm: float | None
    follows: CurveFollows
    unit: str
    strut: int | None
    form: str
    period: float | None
    direction: tuple[float, ...]
    convention: str
    readings_um: float
    unconcealed_um: float
    points: tuple[UnexplainedPoint, ...]


@dataclass(frozen=True)
class UnexplainedResult:
    """The unmodelled residual."""

    rms_um: float
    strut: int | None
    variable: str | None
    text: str
    curve: UnexplainedCurve | None


@dataclass(frozen=True)
class ParameterShift:
    """Bias of a kinematic parameter; `before_um` without the found causes."""

    parameter: str
    before_um: float
    after_um: float
    shift_um: float
    uncertainty_um: float


@dataclass(frozen=True, kw_only=True)
class ProposedTest:
    """A circle to measure next."""

    text: str
    x_mm: float
    y_mm: float
    z_mm: float
    a_deg: float
    b_deg: float
    elevation_deg: float
    feed_mm_min: float
    wait_s: float
    source: str
    sigma_before: float
    sigma_after: float
    unit: str


@dataclass(frozen=True, kw_only=True, eq=False)
class DiagnosisFigures(Framed):
    """Results of a diagnosis: kinematic calibration `before`, joint model `after`.

    Attributes:
        mismatch: whether recordings contradict the kinematic model.
        probability: of that misfit by chance.
        held_out: `tested`, or `not-tested` for too few tests.
        held_out_worse: whether predictions get worse; None if not tested.
        second_start_agrees: whether a second search agrees; None without one.
        limits: search, parameters and joint fit that ended at a limit.
        levels: existence, variables and cause of a difference.
    """

    mismatch: bool
    probability: float
    noise_um: float
    misfit_rms_um: float
    residual_rms_um: BeforeAfter
    held_out_rms_um: BeforeAfter
    held_out_normalised: BeforeAfter
    held_out: str
    held_out_worse: bool | None
    circularity_um: tuple[CircularityLeft, ...]
    workspace: WorkspaceGain | None
    outliers: tuple[Outlier, ...]
    locations: tuple[MisfitLocation, ...]
    sources: ByName[CauseResult]
    cancelling: Cancelling | None
    unexplained: UnexplainedResult
    parameter_shift: tuple[ParameterShift, ...]
    second_start_agrees: bool | None
    next_test: ProposedTest | None
    further_tests: tuple[ProposedTest, ...]
    levels: Levels
    limits: tuple[LimitReached, ...] = ()

    def sentences(self) -> list[str]:
        """Return the answer in three levels, in words; a notebook shows it above the table."""
        values = {one.name: one.parameters for one in self.sources}
        what = "Measured circles and the kinematic model"
        return level_sentences(self.levels, "µm", values, rows="tests", what=what)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def said(self) -> tuple[str, ...]:
        """Return whether anything differs, and its main variable, in two sentences for a report or a screen."""
        return short_sentences(self.levels, "µm", "Measured circles and the kinematic model")

    @property
    def identified(self) -> tuple[CauseResult, ...]:
        """Return causes with the verdict `identified`."""
        return tuple(one for one in self.sources if one.verdict == "identified")

    def headline(self) -> str:
        """Return the misfit and what is identified."""
        named = ", ".join(one.name for one in self.identified) or "nothing"
        if not self.mismatch:
            return f"the recordings agree with the kinematic model, {self.noise_um:.2f} µm noise"
        return f"misfit {self.misfit_rms_um:.2f} µm rms beyond noise; identified: {named}"

    def rows(self) -> list[dict[str, object]]:
        """Return one row per cause."""
        return [
            {
                "cause": one.name,
                "verdict": one.verdict,
                "probability": one.probability,
                "log_bayes_factor": one.gain,
                "concealed": one.concealed,
            }
            for one in self.sources
        ]


@dataclass(frozen=True, kw_only=True, eq=False)
class DiagnosisResult(DiagnosisFigures):
    """The result of a diagnosis."""

    effects: tuple[CauseContribution, ...]
    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)
    recorded: Annotated[Any, AsItIs, Kept] = field(default=None, repr=False)

    def _save(self, path: Path, provenance: Provenance, *, force: bool) -> None:
        write_model(path, self.model, provenance=provenance, force=force)
