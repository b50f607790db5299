"""Wrong CMM coordinates of a ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class BallCoordinate(LinearSource):
    """A ball's CMM coordinates are wrong in all its mountings.

    CMM uncertainty and typing errors are one cause.
    """

    name = "ball-coordinate"
    belongs_to = Owner.SESSION
    texts = Texts(
        what="A ball's coordinates on the CMM sheet are wrong, or the ball stands in another bore than the plan says.",
        shows="Every test at that ball is shifted by the same vector, however often the holder is put up again.",
        confirm="Measure the ball again on the CMM; check bore and holder against the plan.",
        cure="Correct the CMM sheet and calibrate again; no measurement has to be repeated.",
        equation="b = CMM centre + error of this entry",
        origin="CMM calibration certificate; the plan's `uncertainty_um`",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return tuple(Parameter(f"{axis}_mm", "mm", 0.001, f"ball actual minus CMM {axis.upper()}") for axis in "xyz")

    def shared_by(self, motion: Motion) -> str:
        return "" if motion.setup is None else motion.setup.ball

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(fixed_ball_mm=np.eye(3))

    def stated_mm(self, motion: Motion) -> Floats | None:
        return None if motion.setup is None else np.full(3, motion.setup.ball_uncertainty_mm)
