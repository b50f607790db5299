"""Scale error of the bar's encoder."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class BarGain(LinearSource):
    """The reading error is proportional to the encoder's travel from the calibrated length.

    The commanded travel is used. To first order r = n + J p, with commanded less calibrated length n and geometric
    errors p. Scaled by 1 + s this is n + J p' + s n, and p' = (1 + s) p cannot be distinguished from p. Only s n
    remains, visible if one bar measures circles of several sizes.
    """

    name = "bar-gain"
    belongs_to = Owner.INSTRUMENT
    varies_with = "commanded distance"
    form_uncertainty = 0.1  # a scale is off in more ways than in proportion
    texts = Texts(
        what="The encoder in the bar shows a little more or less than a millimetre for each millimetre.",
        shows="Circles that are larger or smaller than the length at which the bar was calibrated are off in their mean radius, in proportion. "
        "All deviations of a circle are off by the same share, which geometric errors that are so much larger do as well.",
        confirm="Measure one test with two radii, some millimetres apart, and the same bar; or move the bar by a millimetre against a better "
        "length gauge.",
        cure="Let the encoder be calibrated at two lengths; measure circles as large as the bar was calibrated.",
        equation="reading = distance + s n, n = commanded distance less calibrated length of the bar",
        origin="gain of a length encoder; one that is stated to 0.3 % is off by 3 µm/mm",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (
            Parameter(
                "gain_um_mm", "µm/mm", 3.0, "reading less true way, for each millimetre from the calibrated length"
            ),
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        """Return the commanded travel; zero without calibrated length or ball place."""
        setup = motion.setup
        if setup is None or setup.bar_length_mm is None or not setup.place_known:
            return Effect(reading_mm=np.zeros((len(motion), 1)))
        distance = np.linalg.norm(motion.poses[:, :3] - setup.fixed_ball_mm, axis=1)
        return Effect(reading_mm=MM_PER_UM * (distance - setup.bar_length_mm)[:, None])
