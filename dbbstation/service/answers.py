"""What the station shows of its steps' results; files have everything."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.facts.held import ComparedTolerance, ReportVerdict, ToleranceOfTest


@dataclass(frozen=True)
class TextAnswer:
    """Something in words."""

    text: str


@dataclass(frozen=True)
class MisfitAnswer:
    """Whether physics is missing, and the residual beyond noise and mountings [µm]."""

    missing_physics: bool
    rms_um: float


@dataclass(frozen=True)
class PlanCheckAnswer:
    """Whether the tests can check their plan, their number, and degrees of freedom."""

    enough: bool
    tests: int
    left: int


@dataclass(frozen=True)
class CalibrationAnswer:
    """Shown facts of a calibration; lengths in µm."""

    parameters_identified: int
    nominal_rms_um: float
    residual_rms_um: float
    residual_within_mounting_rms_um: float
    noise_um: float
    misfit: MisfitAnswer
    outliers: tuple[TextAnswer, ...]
    directions_lost: tuple[str, ...]
    gaps: tuple[str, ...]
    plan_check: PlanCheckAnswer


@dataclass(frozen=True)
class CauseAnswer:
    """A cause and its verdict."""

    name: str
    verdict: str


@dataclass(frozen=True)
class DiagnosisAnswer:
    """Shown facts of a diagnosis; lengths in µm."""

    mismatch: bool
    misfit_rms_um: float
    noise_um: float
    sources: tuple[CauseAnswer, ...]
    unexplained: TextAnswer
    next_test: TextAnswer | None
    limits: tuple[TextAnswer, ...] = ()
    said: tuple[str, ...] = ()


@dataclass(frozen=True)
class ProgramAnswer:
    """Greatest correction of a program [µm]; None if nominal."""

    greatest_correction_um: float | None


@dataclass(frozen=True)
class ProgramsAnswer:
    """The dialect and its programs."""

    dialect: str
    programs: tuple[ProgramAnswer, ...]


@dataclass(frozen=True)
class ReportAnswer:
    """Shown facts of a report."""

    verdict: ReportVerdict
    tolerances: tuple[ComparedTolerance, ...] = ()


@dataclass(frozen=True)
class AcceptanceAnswer(ReportAnswer):
    """Tolerances of two sessions, in total and by test."""

    tolerances_by_test: tuple[ToleranceOfTest, ...] = ()
