"""Error source: the spindle grows as it warms up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.warm_up import EQUATION, ORIGIN, grown, grown_by, warm_up_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3

_OUT_OF_THE_SPINDLE = np.array([0.0, 0.0, -1.0])
"""Which way the tool tip moves, platform frame: away from the platform, which lies above it [1]."""


class SpindleGrowth(ErrorSource):
    """The tool tip moves out of the spindle along its axis by the growth g(t) of `warm_up`.

    Counted from the session's first sample, where the growth is zero by definition. A bar level with its ball does not
    see it while the spindle is upright; tilted circles are shifted by g sin(tilt).
    """

    name = "spindle-growth"
    belongs_to = Owner.MACHINE
    needs = frozenset({Need.TIME})
    varies_with = "time"
    texts = Texts(
        what="The spindle and its nose warm up and push the tool out of the platform. The growth given is counted from "
        "the first sample of the session.",
        shows="Tilted circles wander sideways in the direction that the tool points to, upright ones stay; both "
        "directions drift alike.",
        confirm="Touch the ball or a tool with a dial gauge along the spindle's axis, cold, and again after the same "
        "time and speed as in the measurement.",
        cure="Measure with the spindle at rest and cool; else let it warm up at working speed first, or enter its growth "
        "as a tool length that follows the spindle's temperature.",
        equation=f"tool tip moves along -z of the platform by g(t) = {EQUATION}",
        origin=f"thermal distortion caused by a rotating spindle, ISO 230-3; {ORIGIN}",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        """Growth in the end, time constant, what pauses take back."""
        meaning = "way of the tool tip out of the spindle, from the first sample on"
        return warm_up_parameters(Parameter("growth_um", "µm", 10.0, meaning), 1800.0)

    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """Shift of the tool tip.

        Raises:
            ModelError: the motion has no time.
        """
        self.require(motion)
        return Effect(tool_tip_mm=MM_PER_UM * grown(motion, values)[:, None] * _OUT_OF_THE_SPINDLE)

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """By the three parameters of the law.

        Raises:
            ModelError: the motion has no time.
        """
        self.require(motion)
        law = MM_PER_UM * grown_by(motion, values)
        return Effect(tool_tip_mm=_OUT_OF_THE_SPINDLE[:, None] * law[:, None, :])
