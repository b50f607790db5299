"""What the comparison of circles came to: the most probable set of causes with its joint fit, and all that it needed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.hypotheses import CLOSE, search

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.calibration.outliers.outlier import Outlier
    from dbbstation.diagnosis.channel import CircleChannel
    from dbbstation.diagnosis.unmodelled import Unmodelled
    from dbbstation.inference.harmonics import Misfit, Spectrum
    from dbbstation.inference.hypotheses import Hypothesis, Posterior
    from dbbstation.inference.model_comparison import Cause, Member, ModelComparison

MOST_MEMBERS = 12
"""Causes of a hypothesis at the most: it grows no further. Sessions that the list explains have at most 8."""


@dataclass(frozen=True, eq=False)
class SettledCircles:
    """What the comparison came to.

    Attributes:
        after: joint fit of base and named causes of the most probable hypothesis.
        posterior: over sets of causes, about that fit.
        best: its most probable hypothesis, or one as probable, whose named causes were fitted.
        unmodelled: those among them that have no name.
        noise: measured on what all causes together leave.
        left: misfit of the joint fit.
        refused: causes that cannot be what these recordings show, and why.
        scatter: how many times as much as stated balls scatter.
        stopped: somebody interrupted the comparison; this is what it had come to.
    """

    after: Calibration
    posterior: Posterior
    best: Hypothesis
    comparison: ModelComparison
    causes: tuple[Cause, ...]
    unmodelled: Unmodelled
    noise: Spectrum
    left: Misfit
    refused: Mapping[str, str] = field(default_factory=dict)
    scatter: float = 1.0
    stopped: bool = False

    def second_start_agrees(self) -> bool:
        """Whether a search that begins with nothing, about the same fit, comes to the same most probable set of causes."""
        anew = search(self.comparison, self.causes, most_members=MOST_MEMBERS, likely=CLOSE)
        return anew.best.names == self.posterior.best.names

    @property
    def members(self) -> tuple[Member, ...]:
        """Named causes of the most probable hypothesis."""
        return tuple(m for m in self.best.members if m.cause.named)

    @property
    def noise_mm(self) -> float:
        """Standard deviation, per sample, of white noise that would act on smooth effects as this one does [mm]."""
        return float(np.sqrt(self.noise.power[0]))


@dataclass(frozen=True, eq=False)
class Explained:
    """Everything that the comparison needs and found.

    Attributes:
        before: fit of the base model.
        outliers: balls and runs that are off, kept from pulling it.
        settled: what the comparison came to.
    """

    before: Calibration
    outliers: tuple[Outlier, ...]
    channel: CircleChannel
    first: Misfit
    settled: SettledCircles
