"""Offset of the moving ball from the tool tip."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class ToolBallOffset(LinearSource):
    """The spindle's ball is displaced from the programmed tip, by one vector per session.

    Readings cannot distinguish it from shifting all platform joints by dP_i = -o, but the ball is removed after the test.
    """

    name = "tool-ball-offset"
    belongs_to = Owner.SESSION
    form_uncertainty = 0.0  # a rigid shift is exact
    texts = Texts(
        what="The ball in the spindle is not at the tool tip that the control reckons with: its length was entered "
        "wrongly, or its holder runs out.",
        shows="Upright circles are all shifted by the same vector, as if the table stood elsewhere; the spindle tilted, "
        "they are shifted by what the tilt turns the vector to.",
        confirm="Turn the spindle by 180 degrees and repeat a circle: the part across the axis changes its sign. Measure "
        "the length from the spindle's nose to the ball on a setting gauge.",
        cure="Set the ball to the axis with a dial gauge (its holder has screws for that) and enter its length; nothing "
        "in the machine is wrong.",
        equation="reading = |t + R o - b|; the same as dP_i = -o for all six platform joints",
        origin="rigid-body geometry of [CAL eq 1]; [CAL III-A] counts it among the set-up errors",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return tuple(
            Parameter(f"{axis}_mm", "mm", 0.02, f"ball actual minus programmed tool tip, platform {axis}")
            for axis in "xyz"
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(tool_tip_mm=np.eye(3))
