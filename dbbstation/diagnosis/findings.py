"""Results of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from pydantic import Field, computed_field

from dbbstation.diagnosis.shapes import Follows
from dbbstation.facts.serialise import Absent, Kept, OrNull
from dbbstation.facts.value import Value
from dbbstation.inference.levels import Acts, CatalogueFinding, Gains

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.effects import WorkspaceError
    from dbbstation.inference.alternatives import Cancelling
    from dbbstation.inference.folds import HeldOut
    from dbbstation.inference.harmonics import Misfit
    from dbbstation.inference.levels import Levels, LimitReached


@dataclass(frozen=True, kw_only=True)
class SourceFinding(CatalogueFinding):
    """Finding on one source.

    Attributes:
        concealed: share of squares absorbed by machine parameters.
        stability: selection frequency in draws of seven tenths of tests; None if not computed.
        probability: given the catalogue; for its class if it has one.
        equivalent: equivalent causes, this one included; `class` in JSON.
        log_evidence: the gain under its old name.
        persists: whether held-out tests confirm a single event.
        sigmas: norm over standard deviation; 0 if outside the best set.
        gains: held-out gains; None if not tested.
        parameters: fitted values; for an absent cause the best amplitudes, whose uncertainty bounds an undetected effect.
    """

    concealed: float | None = None
    signature_rms_um: Annotated[float | None, Absent] = None
    unconcealed_rms_um: Annotated[float | None, Absent] = None
    gain: float | None = None
    stability: float | None = None
    probability: float | None = None
    equivalent: Annotated[tuple[str, ...], Field(serialization_alias="class")] = ()
    log_evidence: float | None = None
    acts: Acts | None = None
    persists: bool = False
    sigmas: float | None = None
    gains: Gains | None = None
    parameters: Mapping[str, Value] = field(default_factory=dict)
    text: str


@dataclass(frozen=True)
class ArcOfRun:
    """An arc of one run.

    Attributes:
        theta_deg: first and last angle, from +X towards +Y.
    """

    test: str
    direction: str
    theta_deg: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Location(ArcOfRun):
    """A place of large misfit.

    Attributes:
        strut: 1 to 6; None if no strut is significant.
        variable: None in JSON if it is empty.
        peak_um: greatest smoothed deviation.
    """

    strut: int | None
    variable: OrNull
    share: float
    peak_um: float

    @computed_field  # type: ignore[prop-decorator]
    @property
    def text(self) -> str:
        """Return the place in words."""
        first, last = self.theta_deg
        by = f", by {self.variable}" if self.variable else ""
        strut = f", strut {self.strut} most" if self.strut else ""
        where = f"test {self.test} {self.direction} from {first:.0f} to {last:.0f} degrees"
        return f"{where}: up to {self.peak_um:+.1f} µm{by}{strut}"


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
        direction: of the strongest motion, 3 to 6 components as in `convention`; empty for a scalar.
        convention: removed part that fitted parameters can explain.
        unconcealed_um: part that fitted machine parameters do not absorb.
        points: ascending; linear or a wave in between.
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

    @computed_field  # type: ignore[prop-decorator]
    @property
    def variable(self) -> str:
        """Return the variable as printed."""
        return str(self.follows)

    @computed_field  # type: ignore[prop-decorator]
    @property
    def period_mm(self) -> float | None:
        """Return a length wave's period [mm], else None."""
        return self.period if self.follows.variable == "strut-length" else None


@dataclass(frozen=True)
class Unexplained:
    """The unmodelled residual."""

    rms_um: float
    strut: int | None
    follows: Annotated[Follows | None, Kept]
    gain: Annotated[float, Kept]
    text: str
    curve: Curve | None = None

    @computed_field  # type: ignore[prop-decorator]
    @property
    def variable(self) -> str | None:
        """Return the variable as printed, or None."""
        return None if self.follows is None else str(self.follows)


@dataclass(frozen=True)
class Shift:
    """Bias of a kinematic parameter in the earlier calibration.

    Attributes:
        before_um: value without found sources.
    """

    parameter: str
    before_um: float
    after_um: float
    shift_um: float
    uncertainty_um: float


@dataclass(frozen=True, kw_only=True)
class NextTest:
    """A circle worth measuring next.

    Attributes:
        source: cause to reveal or distinguish.
        sigma_before: standard uncertainty by earlier tests: of its amplitude, or of the most improved combination.
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


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All results of a diagnosis.

    Attributes:
        held_out: prediction errors before and after [mm].
        held_out_worse: whether selections without each group of tests predict it worse; None without causes or for few tests.
        workspace: the calibration's error over the workspace; None without findings.
        second_start_agrees: None if interrupted.
        cancelling: cancelling effects [mm], or None.
    """

    mismatch: bool
    misfit: Misfit
    left: Misfit
    before: Calibration
    after: Calibration
    held_out: tuple[HeldOut, HeldOut]
    held_out_worse: bool | None
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
