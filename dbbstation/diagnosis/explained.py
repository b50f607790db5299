"""Results of comparing causes of circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.hypotheses import CLOSE, search
from dbbstation.inference.settled import Outcome

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.unmodelled import Unmodelled
    from dbbstation.inference.harmonics import Misfit, Spectrum
    from dbbstation.inference.model_comparison import Member


@dataclass(frozen=True, eq=False, kw_only=True)
class SettledCircles(Outcome):
    """The outcome of the comparison, linearised about the joint fit.

    Attributes:
        after: joint fit of base and named causes.
        noise: estimated with all causes.
        scatter: of balls, in stated standard deviations.
    """

    after: Calibration
    target: Floats
    unmodelled: Unmodelled
    noise: Spectrum
    left: Misfit
    scatter: float = 1.0

    def second_start_agrees(self) -> bool:
        """Return whether a search without seeds agrees."""
        anew = search(self.comparison, self.causes, most_members=BOUNDS.members, likely=CLOSE)
        return anew.best.names == max(self.posterior.weights, key=self.posterior.weights.__getitem__)

    @property
    def members(self) -> tuple[Member, ...]:
        """Return the best hypothesis's named causes."""
        return tuple(m for m in self.best.members if m.cause.named)

    @property
    def noise_mm(self) -> float:
        """Return the white noise per sample that affects smooth quantities equally [mm]."""
        return float(np.sqrt(self.noise.power[0]))


@dataclass(frozen=True, eq=False)
class Explained:
    """Inputs and results of the comparison."""

    before: Calibration
    outliers: tuple[Outlier, ...]
    channel: CircleChannel
    first: Misfit
    settled: SettledCircles
