"""A ball that is not round."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

MM_PER_UM = 1e-3

ORDERS = (2, 3, 4, 5)
"""Undulations per turn of balls of standard grades. Order 0 is the bar's length, order 1 the ball's place."""


class BallForm(LinearSource):
    """Where the fixed ball's surface is higher by h, the reading is lower by h.

    With direction n from fixed to moving ball, h = Re sum (a_k - i b_k) (n_x + i n_y)^k, k = 2 ... 5, sectoral
    spherical harmonics. For a level bar this is a_k cos k theta + b_k sin k theta. A mark on the ball fixes its
    orientation in every mounting. Level circles also touch the moving ball all round, so the result contains both
    balls' forms.
    """

    name = "ball-form"
    belongs_to = Owner.INSTRUMENT
    varies_with = "angle"
    form_uncertainty = 0.05  # form errors of balls are measured to a few per cent
    texts = Texts(
        what="The ball that the bar turns about is not round, or dirty: the bar's cup is lifted by it.",
        shows="The same small figure of two to five lobes in every circle, at every place and tilt and in both "
        "directions, however well the machine is calibrated.",
        confirm="Turn the ball on its holder by 90 degrees and repeat a circle: the figure turns with it. Clean ball "
        "and cups first. The calibration certificate states the ball's deviation from spherical form.",
        cure="Clean or exchange the ball; grade 5 balls are round to 0.13 µm.",
        equation="reading = distance - h(n), h = sum of a_k cos k theta + b_k sin k theta for k = 2 to 5, times the "
        "cosine of the bar's elevation to the power k",
        origin="sectoral spherical harmonics; deviation from spherical form and ball grades of ISO 3290-1",
    )

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return tuple(
            Parameter(
                f"{wave}_{order}_um",
                "µm",
                0.2,
                f"height of the ball's surface as the {name} of {order} times the angle from +X towards +Y",
                part=f"{order} lobes",
            )
            for order in ORDERS
            for wave, name in (("cos", "cosine"), ("sin", "sine"))
        )

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        if motion.setup is None:
            return Effect(reading_mm=np.zeros((len(motion), 2 * len(ORDERS))))
        away = motion.poses[:, :3] - motion.setup.fixed_ball_mm
        across = (away[:, 0] + 1j * away[:, 1]) / np.linalg.norm(away, axis=1)
        waves = [part for order in ORDERS for part in ((across**order).real, (across**order).imag)]
        return Effect(reading_mm=-MM_PER_UM * np.column_stack(waves))
