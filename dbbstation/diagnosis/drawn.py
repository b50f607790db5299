"""Curves and gains for the figure of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.calibration.reporting.residual_map import CircleBeforeAfter

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats


@dataclass(frozen=True, eq=False)
class Trace(CircleBeforeAfter):
    """One run's deviations as measured, with the kinematic calibration, and with the joint model."""

    measured_um: Floats


@dataclass(frozen=True)
class GainOfTest:
    """One test with all its runs."""

    name: str
    residual_um: tuple[float, float]
    circularity_um: tuple[float, float]
    traces: tuple[Trace, ...]

    @property
    def gain_um(self) -> float:
        """Return the residual's reduction [µm]."""
        return self.residual_um[0] - self.residual_um[1]


@dataclass(frozen=True, eq=False)
class Branch:
    """One curve over bins, shape (b,) each.

    Attributes:
        sense: `lengthening` or `shortening`, or empty.
        model_um: mean error by the source.
        before_um: strut error that would explain the base residual; NaN if hardly determined.
        after_um: the model's error plus the error that would explain the joint residual; NaN if hardly determined.
    """

    sense: str
    variable: Floats
    model_um: Floats
    before_um: Floats
    after_um: Floats
    sigma_um: Floats


@dataclass(frozen=True)
class SourceCurves:
    """Curves of one source.

    Attributes:
        source: empty for the unmodelled residual.
        fine: whether the error may change between bins, as a wave.
        reading: whether it acts on the reading, not on struts.
    """

    source: str
    variable: str
    unit: str
    fine: bool
    struts: tuple[tuple[Branch, ...], ...]
    reading: tuple[Branch, ...]
