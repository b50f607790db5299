"""The result of `demo`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dbbstation.calibration.reporting.evaluation import CircleDeviations


@dataclass(frozen=True, kw_only=True)
class MeasuredBeforeAfter(CircleDeviations):
    """Measured figures of one circle [µm]. The last one excludes the bar's noise."""

    circularity_30_upr_um: float


@dataclass(frozen=True)
class DemoCircle:
    """A test's first circle in its first direction."""

    test: str
    before: MeasuredBeforeAfter
    after: MeasuredBeforeAfter


@dataclass(frozen=True)
class DemoResult:
    """Files and figures of a demonstration.

    Attributes:
        calibration: JSON of `calibrate` as objects; `diagnosis` and `report` likewise.
        printed: JSON of `diagnose` and `report`, by command.
    """

    folder: Path
    runs: tuple[DemoCircle, ...]
    calibration: Any
    diagnosis: Any
    report: Any
    printed: Mapping[str, str]


@dataclass(frozen=True)
class ControlWay:
    """Measured figures of a machine with one kind of correction.

    Attributes:
        runs: those of `evaluate --json`, as objects.
        seconds: LinuxCNC's time for all programs [s].
    """

    way: str
    runs: tuple[Any, ...]
    seconds: float
