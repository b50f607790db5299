"""What `demo` shows: figures before and after, and parts of what its commands printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from dbbstation.calibration.reporting.evaluation import CircleDeviations
from dbbstation.facts.value import Value
from dbbstation.results.diagnosis import BeforeAfter
from dbbstation.results.report import ReportVerdict


@dataclass(frozen=True)
class DemoLowPassed:
    """The circular deviation of the readings without the bar's noise [µm]."""

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
    """Measured figures of one circle; in µm.

    Attributes:
        centre_deviation_um: length of the least-squares centre's offset.
        mean_radial_error_um: mean of length less radius.
        circularity_um: circular deviation with the bar's noise.
    """

    centre_deviation_um: float
    mean_radial_error_um: float
    circularity_um: float
    circularity_30_upr_um: float


@dataclass(frozen=True)
class DemoCircle:
    """The first circle of a test in its first direction.

    Attributes:
        before: under nominal programs.
        after: under compensated programs.
    """

    test: str
    before: MeasuredBeforeAfter
    after: MeasuredBeforeAfter


@dataclass(frozen=True)
class DemoCalibration:
    """What a kinematic calibration alone leaves within mountings [µm]."""

    residual_within_mounting_rms_um: float


@dataclass(frozen=True)
class DemoCause:
    """A cause: its verdict, the share that the kinematic parameters conceal, and its parameters."""

    name: str
    verdict: str
    concealed: float | None
    parameters: Mapping[str, Value]


@dataclass(frozen=True)
class DemoDiagnosis:
    """What the diagnosis found, and how well held-out tests are predicted [µm] where they are `tested`."""

    sources: tuple[DemoCause, ...]
    held_out: str
    held_out_rms_um: BeforeAfter


@dataclass(frozen=True)
class DemoRanked:
    """A cause of what was measured before, with what it contributes to G and to the centres [µm], and its cure."""

    cause: str
    g_um: float
    centre_um: float
    cure: str


@dataclass(frozen=True)
class DemoReport:
    """What the report says, and the causes that it ranks."""

    verdict: ReportVerdict
    causes: tuple[DemoRanked, ...]


@dataclass(frozen=True)
class DemoResult:
    """Files and figures of a demonstration.

    Attributes:
        calibration: what `calibrate` left.
        diagnosis: what `diagnose` found.
        printed: everything that `diagnose` and `report` printed as JSON, by the command.
    """

    folder: Path
    runs: tuple[DemoCircle, ...]
    calibration: DemoCalibration
    diagnosis: DemoDiagnosis
    report: DemoReport
    printed: Mapping[str, str]
