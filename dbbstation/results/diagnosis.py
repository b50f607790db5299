"""Which physics a calibration leaves out: the result of `diagnose`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from pydantic import Field

from dbbstation.calibration.outliers.outlier import Outlier
from dbbstation.facts.serialise import Absent, AsItIs, Kept
from dbbstation.facts.value import Value
from dbbstation.inference.cancelling import Cancelling
from dbbstation.inference.verdict import Gains
from dbbstation.model.identified import IdentifiedModel
from dbbstation.results.effects import CauseContribution
from dbbstation.results.frame import Framed


@dataclass(frozen=True)
class BeforeAfter:
    """A figure under the kinematic calibration (before) and under the joint model (after)."""

    before: float
    after: float


@dataclass(frozen=True)
class CircularityLeft:
    """Circularity that is left of one run [µm].

    Attributes:
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        before: under the kinematic calibration [µm].
        after: under the joint model [µm].
    """

    test: str
    direction: str
    repeat: int
    before: float
    after: float


@dataclass(frozen=True)
class WorkspaceGain:
    """How far apart kinematic calibration and joint model put the tool over the workspace.

    Attributes:
        error_rms_um: without the common shift [µm].
        uncertainty_rms_um: standard uncertainty of the joint model there; None where not known [µm].
        common_shift_um: mean of X, Y and Z [µm].
        uncertainty_with_shift_rms_um: likewise; None where not known [µm].
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
    """Where the misfit of the kinematic calibration is large.

    Attributes:
        direction: `ccw` or `cw`.
        strut: 1 to 6; None where no one stands out.
        variable: what it follows; None where nothing does.
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
        name: of the error source.
        verdict: one of the six words of docs/verdicts.md.
        ambiguous_with: causes that explain the recordings about as well.
        concealed: R² of its effect on the kinematic parameters.
        signature_rms_um: size of its effect on the readings [µm].
        unconcealed_rms_um: part of that which no kinematic parameter can imitate [µm].
        gain: log Bayes factor.
        stability: selection frequency.
        equivalent: causes that these recordings cannot tell apart from it; `class` in JSON.
        log_evidence: the gain, under its older name.
        acts: `always` or `once`.
        persists: it happened once, and held-out tests tell of it, too.
        gains: in tests that were held back; None where none were.
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
    """What an unmodelled effect is a function of.

    Attributes:
        kind: of curve, such as `wave`; empty for the usual one.
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
    """An unmodelled effect as a function of what organises it.

    Attributes:
        variable: what it follows, as printed.
        period_mm: of a wave of strut length [mm]; None for all others.
        strut: 1 to 6; None where all struts follow it, or no strut's error is meant.
        form: which of its kind, in words; empty where there is one.
        period: of a wave, in the variable's unit; None for what is none.
        direction: in which what it moves does so most; empty where that is one number.
        convention: what was taken out of it because fitted parameters make that; empty where nothing was.
        readings_um: root mean square of what it does to the readings [µm].
        unconcealed_um: of what the fitted machine parameters leave of that [µm].
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
    """The unmodelled residual.

    Attributes:
        strut: 1 to 6; None where it is not one strut's.
        variable: what it follows; None where nothing does clearly.
        curve: the error along the variable; None where nothing organises it.
    """

    rms_um: float
    strut: int | None
    variable: str | None
    text: str
    curve: UnexplainedCurve | None


@dataclass(frozen=True)
class ParameterShift:
    """Bias of a parameter of the kinematic calibration.

    Attributes:
        before_um: without the causes that were found [µm].
    """

    parameter: str
    before_um: float
    after_um: float
    shift_um: float
    uncertainty_um: float


@dataclass(frozen=True, kw_only=True)
class ProposedTest:
    """A circle to measure next.

    Attributes:
        source: cause whose uncertainty it brings down.
    """

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
    """Everything that a diagnosis says; what is `before` is the kinematic calibration, what is `after` the joint model.

    Attributes:
        mismatch: whether the recordings differ from the kinematic model.
        probability: of that misfit by chance.
        held_out_rms_um: error of predicting held-out tests [µm].
        held_out: `tested`, or `not-tested` where the tests are too few.
        held_out_worse: whether what was found predicts worse; None where not tested.
        workspace: how far both models are apart; None where nothing was found.
        outliers: kept out of the fits.
        cancelling: effects of named causes on the readings that cancel each other; None where none do.
        unexplained: the unmodelled residual.
        second_start_agrees: whether a second search came to the same causes; None where there was none.
        next_test: what to measure next; None: no proposal.
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
    sources: tuple[CauseResult, ...]
    cancelling: Cancelling | None
    unexplained: UnexplainedResult
    parameter_shift: tuple[ParameterShift, ...]
    second_start_agrees: bool | None
    next_test: ProposedTest | None
    further_tests: tuple[ProposedTest, ...]

    @property
    def identified(self) -> tuple[CauseResult, ...]:
        """Causes with the verdict `identified`."""
        return tuple(one for one in self.sources if one.verdict == "identified")

    def rows(self) -> list[dict[str, object]]:
        """Causes, one row for each."""
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
    """What a diagnosis found.

    Attributes:
        effects: what each cause of the joint model contributes to the circles, the greatest circular deviation first.
        model: the joint model, to predict and compensate with, or to write to a file.
    """

    effects: tuple[CauseContribution, ...]
    model: Annotated[IdentifiedModel, AsItIs, Kept] = field(repr=False)
