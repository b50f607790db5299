"""Error source: the spindle grows as it warms up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, ErrorSource, Motion, Need, Owner, Parameter, Texts
from dbbstation.sources.warm_up import grown_by, time_constant, warmed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3

_OUT_OF_THE_SPINDLE = np.array([0.0, 0.0, -1.0])
"""Which way the tool tip moves, platform frame: away from the platform, which lies above it [1]."""


class SpindleGrowth(ErrorSource):
    """The tool tip moves out of the spindle along its axis: a (1 - exp(-t / tau)).

    Counted from the session's first sample, where the growth is zero by definition. A bar level with its ball does not
    see it while the spindle is upright; tilted circles are shifted by a sin(tilt).
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
        equation="tool tip moves along -z of the platform by a (1 - exp(-t / tau)), t since the session's first sample",
        origin="thermal distortion caused by a rotating spindle, ISO 230-3; first-order warm-up",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        """Growth in the end and time constant."""
        return (
            Parameter("growth_um", "µm", 10.0, "way of the tool tip out of the spindle, from the first sample on"),
            time_constant(1800.0, "the growth"),
        )

    def effect(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """Shift of the tool tip.

        Raises:
            ModelError: the motion has no time.
        """
        growth_mm = MM_PER_UM * values[0] * warmed(self._time_s(motion), values[1])
        return Effect(tool_tip_mm=growth_mm[:, None] * _OUT_OF_THE_SPINDLE)

    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:  # noqa: ARG002
        """By the growth and by the time constant.

        Raises:
            ModelError: the motion has no time.
        """
        law = MM_PER_UM * grown_by(self._time_s(motion), *values)
        return Effect(tool_tip_mm=_OUT_OF_THE_SPINDLE[:, None] * law[:, None, :])

    def _time_s(self, motion: Motion) -> NDArray[np.float64]:
        self.require(motion)
        return np.asarray(motion.time_s)
