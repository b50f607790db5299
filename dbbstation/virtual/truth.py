"""Random errors of the virtual machine, reproducible by seed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import sources_named
from dbbstation.virtual.under_spindle import SET_UP_MM, SetUp

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.plan import Ball

JOINT_ERROR_MM = 0.1
"""Standard deviation of strut reference lengths and of joint coordinates of a random machine [mm]."""

_KINEMATIC = ("strut-reference-length", "base-joints")


def random_kinematics(machine: Machine, seed: int) -> tuple[Fitted, ...]:
    """Return 24 random kinematic errors."""
    rng = np.random.default_rng([seed, 1])
    return tuple(
        Fitted(source, rng.normal(0.0, JOINT_ERROR_MM, len(source.parameters(machine))))
        for source in sources_named(_KINEMATIC)
    )


@dataclass
class MeasurementErrors:
    """Errors of mountings, ball coordinates and bar.

    Args:
        seed: a ball's errors do not depend on other mountings.
        set_up_mm: standard deviation per axis of a set-up by hand under the spindle.
    """

    seed: int
    bar_uncertainty_mm: float
    set_up_mm: float = SET_UP_MM
    _of_balls: dict[str, Fitted] = field(default_factory=dict)
    _of_mountings: dict[int, Fitted] = field(default_factory=dict)

    def bar(self, shared: str) -> Fitted:
        """Return the length error of the bar."""
        rng = np.random.default_rng([self.seed, 2])
        (source,) = sources_named(("bar-offset",))
        return Fitted(source, rng.normal(0.0, self.bar_uncertainty_mm, 1), shared)

    def ball(self, ball: Ball, shared: str) -> Fitted:
        """Return a ball's coordinate error, common to its mountings."""
        if ball.name not in self._of_balls:
            rng = np.random.default_rng([self.seed, 3, *ball.name.encode()])
            (source,) = sources_named(("ball-coordinate",))
            self._of_balls[ball.name] = Fitted(source, rng.normal(0.0, ball.uncertainty_mm, 3), shared)
        return self._of_balls[ball.name]

    def mounting(self, ball: Ball, number: int, shared: str) -> Fitted:
        """Return a ball's position in its `number`-th mounting."""
        if number not in self._of_mountings:
            rng = np.random.default_rng([self.seed, 4, number])
            (source,) = sources_named(("mounting",))
            self._of_mountings[number] = Fitted(source, rng.normal(0.0, ball.repeatability_mm, 3), shared)
        return self._of_mountings[number]

    def set_up(self, number: int) -> SetUp:
        """Return the balls' positions at the tip in the `number`-th mounting under the spindle."""
        return SetUp.drawn(np.random.default_rng([self.seed, 6, number]), self.set_up_mm)

    def all(self) -> tuple[Fitted, ...]:
        """Return all drawn errors of balls and mountings."""
        return (*self._of_balls.values(), *self._of_mountings.values())
