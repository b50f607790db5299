"""The result of `demo`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dbbstation.calibration.reporting.evaluation import CircleDeviations
from dbbstation.facts.held import ReportVerdict
from dbbstation.facts.value import Value
from dbbstation.results.diagnosis import BeforeAfter


@dataclass(frozen=True)
class DemoLowPassed:
    """Circular deviation without the bar's noise [µm]."""

    measured: float


@dataclass(frozen=True)
class DemoRun:
    """Measured figures of a run."""

    test: str
    direction: str
    measured: CircleDeviations
    circularity_30_upr_um: DemoLowPassed


@dataclass(frozen=True)
class DemoEvaluation:
    """Measured figures of all runs of a session."""

    runs: tuple[DemoRun, ...]


@dataclass(frozen=True)
class MeasuredBeforeAfter:
    """Measured figures of one circle [µm].

    Attributes:
        centre_deviation_um: least-squares centre's offset.
        mean_radial_error_um: mean length less radius.
    """

    centre_deviation_um: float
    mean_radial_error_um: float
    circularity_um: float
    circularity_30_upr_um: float


@dataclass(frozen=True)
class DemoCircle:
    """A test's first circle in its first direction."""

    test: str
    before: MeasuredBeforeAfter
    after: MeasuredBeforeAfter


@dataclass(frozen=True)
class DemoCalibration:
    """Residual of a kinematic calibration within mountings [µm]."""

    residual_within_mounting_rms_um: float


@dataclass(frozen=True)
class DemoCause:
    """A cause: verdict, share absorbed by kinematic parameters, and parameters."""

    name: str
    verdict: str
    concealed: float | None
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class DemoDiagnosis:
    """Diagnosis, and predictions of held-out tests [µm] if `tested`."""

    sources: tuple[DemoCause, ...]
    held_out: str
    held_out_rms_um: BeforeAfter


@dataclass(frozen=True)
class DemoRanked:
    """A cause with its contributions to G and centres [µm], and cure."""

    cause: str
    g_um: float
    centre_um: float
    cure: str


@dataclass(frozen=True)
class DemoReport:
    """The report's statements and ranked causes."""

    verdict: ReportVerdict
    causes: tuple[DemoRanked, ...]


@dataclass(frozen=True)
class DemoResult:
    """Files and figures of a demonstration.

    Attributes:
        printed: JSON of `diagnose` and `report`, by command.
    """

    folder: Path
    runs: tuple[DemoCircle, ...]
    calibration: DemoCalibration
    diagnosis: DemoDiagnosis
    report: DemoReport
    printed: Mapping[str, str]


@dataclass(frozen=True)
class ControlWay:
    """What a bar measures of a machine under one way of correction.

    Attributes:
        seconds: LinuxCNC's time for all programs [s].
    """

    way: str
    runs: tuple[DemoRun, ...]
    seconds: float
