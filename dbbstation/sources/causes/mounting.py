"""Position error of a holder in one mounting."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class Mounting(LinearSource):
    """The ball has another displacement in each mounting [CAL III-B].

    Usual scatter and a bad mounting differ only in size.
    """

    name = "mounting"
    belongs_to = Owner.MOUNTING
    texts = Texts(
        what="A ball holder does not seat in its bore twice in the same way; dirt or a burr makes it worse.",
        shows="All circles of one mounting are shifted together by one to three µm, a badly seated one by far more.",
        confirm="Take the holder out, clean bore and taper, put it back and repeat the test: the shift changes.",
        cure="Clean and tighten; mount a ball more than once and let the fit average.",
        equation="b = CMM centre + shift of this mounting",
        origin="[CAL III-B]: 1.0 µm (short holder) and 3.2 µm (long holder) repeatability",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return tuple(Parameter(f"{axis}_mm", "mm", 0.002, f"ball actual minus CMM {axis.upper()}") for axis in "xyz")

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return Effect(fixed_ball_mm=np.eye(3))

    def stated_mm(self, motion: Motion) -> Floats | None:
        return None if motion.setup is None else np.zeros(3) + motion.setup.mounting_repeatability_mm
