"""A ball that is not round."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import MM_PER_UM, Effect, LinearSource, Motion, Owner, Parameter, Texts

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

ORDERS = (2, 3, 4, 5)
"""Undulations per turn of balls of standard grades. Order 0 is the bar's length, order 1 the ball's place."""

FURTHER = (6, 7, 8)
"""Undulations that a ball may have besides."""

FURTHER_SHARE = 0.2
"""Their height over the rms height of the others, one standard deviation: height falls with the square of the order or faster."""


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
        return Effect(reading_mm=-MM_PER_UM * _waves(_direction(motion), ORDERS))

    def left_open(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        """Return undulations of higher order, and those that change with latitude: tesseral harmonics of two more degrees.

        At elevation e, degree k + 1 grows as (2 k + 1) sin e, degree k + 2 as (2 k + 3) sin^2 e beside order k
        [DLMF 14.7.14, Ferrers functions].
        """
        height_mm = MM_PER_UM * FURTHER_SHARE * float(np.sqrt(np.mean(np.square(values))))
        direction, order = _direction(motion), np.repeat(ORDERS, 2)
        waves, rise = _waves(direction, ORDERS), direction[:, 2:]
        by_latitude = [(2 * order + 1) * rise * waves, (2 * order + 3) * rise**2 * waves]
        return Effect(reading_mm=-height_mm * np.hstack([_waves(direction, FURTHER), *by_latitude]))


def _waves(direction: Floats, orders: tuple[int, ...]) -> Floats:
    """Return cosine and sine of each order at unit vectors, shape (n, 3): shape (n, 2 k)."""
    across = direction[:, 0] + 1j * direction[:, 1]
    return np.column_stack([part for order in orders for part in ((across**order).real, (across**order).imag)])


def _direction(motion: Motion) -> Floats:
    """Return the unit vector from the fixed to the moving ball, shape (n, 3); zero without a fixed ball."""
    if motion.setup is None:
        return np.zeros((len(motion), 3))
    away = motion.poses[:, :3] - motion.setup.fixed_ball_mm
    return np.asarray(away / np.linalg.norm(away, axis=1, keepdims=True), dtype=np.float64)
