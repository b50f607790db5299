"""Answers of a diagnosis: verdicts, places, values with uncertainty."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from dbbstation.facts.value import Value
from dbbstation.inference.verdict import Acts, Gains, Verdict

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.shapes import Follows
    from dbbstation.diagnosis.workspace import WorkspaceError
    from dbbstation.inference.cancelling import Cancelling
    from dbbstation.inference.chosen_anew import ChosenAnew
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.held_out import HeldOut
    from dbbstation.inference.levels import Levels
    from dbbstation.inference.limit_reached import LimitReached

__all__ = [
    "Curve",
    "CurvePoint",
    "Diagnosis",
    "Location",
    "NextTest",
    "Shift",
    "SourceFinding",
    "Unexplained",
    "Value",
    "Verdict",
]


@dataclass(frozen=True)
class SourceFinding:
    """Finding on one source.

    Attributes:
        ambiguous_with: sources of about equal explanation.
        concealed: share of squares absorbed by machine parameters.
        whole_um: signature's rms over runs.
        parameters: fitted; of an absent cause the best amplitudes, whose uncertainty bounds an undetected effect.
        probability: given the catalogue; of its class if any.
        stability: selection frequency over seven tenths of tests; None if not tried.
        equivalent: with itself; may be empty.
        acts: always or once.
        sigmas: norm over standard deviation; 0 if outside the best set.
        gains: held-out; None if not tested.
    """

    name: str
    verdict: Verdict
    ambiguous_with: tuple[str, ...]
    gain: float
    concealed: float
    whole_um: float
    rest_um: float
    parameters: dict[str, Value]
    text: str
    probability: float
    stability: float | None = None
    equivalent: tuple[str, ...] = ()
    acts: Acts = Acts.ALWAYS
    sigmas: float = 0.0
    gains: Gains | None = None

    @property
    def persists(self) -> bool:
        """Return whether held-out tests confirm a single event."""
        return self.verdict is Verdict.HAPPENED and self.gains is not None and self.gains.predicts


@dataclass(frozen=True)
class Location:
    """Where the misfit is.

    Attributes:
        direction: `ccw` or `cw`.
        theta_deg: from, to: from +X towards +Y.
        strut: 1 to 6.
        peak_um: greatest smoothed deviation.
    """

    test: str
    direction: str
    theta_deg: tuple[float, float]
    strut: int | None
    variable: str
    share: float
    peak_um: float


@dataclass(frozen=True)
class CurvePoint:
    """Place, value and standard uncertainty [µm]."""

    at: float
    value_um: float
    uncertainty_um: float


@dataclass(frozen=True)
class Curve:
    """An unmodelled effect as a curve.

    Attributes:
        strut: 1 to 6; None for all struts or none.
        period: of a wave, in the variable's unit; else None.
        direction: of strongest motion, 3 to 6 numbers by `convention`; empty for a scalar.
        convention: removed part that fitted parameters can make.
        readings_um: rms effect on readings.
        unconcealed_um: beyond fitted machine parameters.
        points: rising; straight or a wave between.
    """

    follows: Follows
    unit: str
    strut: int | None
    form: str
    period: float | None
    direction: tuple[float, ...]
    convention: str
    readings_um: float
    unconcealed_um: float
    points: tuple[CurvePoint, ...]

    @property
    def variable(self) -> str:
        """Return the variable as printed."""
        return str(self.follows)

    @property
    def period_mm(self) -> float | None:
        """Return a length wave's period [mm], else None."""
        return self.period if self.follows.variable == "strut-length" else None

    def plain(self) -> dict[str, object]:
        """Return it as plain values for JSON."""
        return {"variable": self.variable, "period_mm": self.period_mm, **asdict(self)}


@dataclass(frozen=True)
class Unexplained:
    """The unmodelled residual.

    Attributes:
        rms_um: beyond noise, low harmonics.
    """

    rms_um: float
    strut: int | None
    follows: Follows | None
    gain: float
    text: str
    curve: Curve | None = None

    @property
    def variable(self) -> str | None:
        """Return the variable as printed, or None."""
        return None if self.follows is None else str(self.follows)


@dataclass(frozen=True)
class Shift:
    """A parameter's bias in the earlier calibration.

    Attributes:
        before_um: without found sources.
    """

    parameter: str
    before_um: float
    after_um: float
    uncertainty_um: float

    @property
    def shift_um(self) -> float:
        """Return the bias [µm]."""
        return self.before_um - self.after_um


@dataclass(frozen=True)
class NextTest:
    """A test worth measuring next.

    Attributes:
        circle: x_mm, y_mm, z_mm, a_deg, b_deg, elevation_deg, feed_mm_min, wait_s.
        source: to reveal or distinguish.
        sigma_before: of its amplitude or most improved combination, with earlier tests.
    """

    text: str
    circle: dict[str, float]
    source: str
    sigma_before: float
    sigma_after: float
    unit: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything found.

    Attributes:
        mismatch: beyond noise.
        left: of the joint model.
        before: base fit.
        held_out: prediction errors before and after [mm].
        chosen_anew: without each group; None without causes or for few tests.
        levels: existence, variables and cause of a difference [µm].
        workspace: the calibration's error away from the tests; None without findings.
        locations: largest share first.
        second_start_agrees: None if interrupted.
        cancelling: [mm], or None.
        limits: of search, parameters, joint fit.
    """

    mismatch: bool
    misfit: Misfit
    left: Misfit
    before: Calibration
    after: Calibration
    held_out: tuple[HeldOut, HeldOut]
    chosen_anew: ChosenAnew | None
    levels: Levels
    outliers: tuple[Outlier, ...]
    workspace: WorkspaceError | None
    locations: tuple[Location, ...]
    sources: tuple[SourceFinding, ...]
    unexplained: Unexplained
    shifts: tuple[Shift, ...]
    second_start_agrees: bool | None
    next_tests: tuple[NextTest, ...]
    cancelling: Cancelling | None = None
    limits: tuple[LimitReached, ...] = ()
