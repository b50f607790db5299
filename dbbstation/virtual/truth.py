"""Random errors of the virtual machine, reproducible by seed; balls put up under the spindle [CAL III-A, Fig 4]."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

import numpy as np

from dbbstation.sources.causes.tool_ball_offset import ToolBallOffset
from dbbstation.sources.contract import Fitted, Motion, Owner, SetUpErrors
from dbbstation.sources.registry import sources_named

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.plan.plan import Ball, Circle
    from dbbstation.sources.contract import Setup

SET_UP_MM = 0.05
"""Standard deviation per axis of the position of balls that were put up by hand [mm]."""

_STANDING_S = np.array([0.0, 1.0, 2.0])
"""Time at rest while a ball is put up [s], long enough that no motion lags."""


class MovingBall(ToolBallOffset):
    """The moving ball's offset from the tip, different each time."""

    name = "moving-ball"
    belongs_to = Owner.MOUNTING


@dataclass(frozen=True, eq=False)
class SetUp:
    """Errors of balls' places; zero by default."""

    fixed_ball_mm: Floats = field(default_factory=lambda: np.zeros(3))
    moving_ball_mm: Floats = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def drawn(cls, rng: np.random.Generator, size_mm: float) -> Self:
        """Draw both balls' errors, one standard deviation per axis [mm]."""
        fixed, moving = rng.normal(0.0, size_mm, (2, 3))
        return cls(fixed, moving)

    def read(self, rng: np.random.Generator, uncertainty_mm: float) -> SetUpErrors:
        """Return a micrometer's reading with this standard deviation [mm]."""
        fixed, moving = rng.standard_normal((2, 3)) * uncertainty_mm
        return SetUpErrors(self.fixed_ball_mm + fixed, self.moving_ball_mm + moving, uncertainty_mm)


def put_up(truth: MachineModel, circle: Circle, setup: Setup, balls: SetUp, at_s: float = 0.0) -> tuple[Fitted, Fitted]:
    """Return the effects of the fixed and the moving ball on the bar.

    Raises:
        KinematicsError: the machine cannot take the pose.
        ModelError: a source needs data that a standing machine lacks.
    """
    pose = np.array([*circle.ball_mm, *circle.tilt_deg])
    standing = Motion(np.tile(pose, (len(_STANDING_S), 1)), is_path=True, time_s=at_s + _STANDING_S, setup=setup)
    tip = truth.of_the_machine().actual(standing).tool_frames().position_mm[-1]
    (mounting,) = sources_named(("mounting",))
    stands = tip + balls.fixed_ball_mm - setup.fixed_ball_mm
    return Fitted(mounting, stands, setup.mounting), Fitted(MovingBall(), balls.moving_ball_mm, setup.mounting)


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
    _fitted: dict[tuple[int, ...], Fitted] = field(default_factory=dict)

    def bar(self, shared: str) -> Fitted:
        """Return the length error of the bar."""
        return self._drawn((2,), "bar-offset", self.bar_uncertainty_mm, shared, 1)

    def ball(self, ball: Ball, shared: str) -> Fitted:
        """Return a ball's coordinate error, common to its mountings."""
        return self._drawn((3, *ball.name.encode()), "ball-coordinate", ball.uncertainty_mm, shared)

    def mounting(self, ball: Ball, number: int, shared: str) -> Fitted:
        """Return a ball's position in its `number`-th mounting."""
        return self._drawn((4, number), "mounting", ball.repeatability_mm, shared)

    def _drawn(self, key: tuple[int, ...], cause: str, size_mm: float, shared: str, count: int = 3) -> Fitted:
        if key not in self._fitted:
            (source,) = sources_named((cause,))
            drawn = np.random.default_rng([self.seed, *key]).normal(0.0, size_mm, count)
            self._fitted[key] = Fitted(source, drawn, shared)
        return self._fitted[key]

    def set_up(self, number: int) -> SetUp:
        """Return the balls' positions at the tip in the `number`-th mounting under the spindle."""
        return SetUp.drawn(np.random.default_rng([self.seed, 6, number]), self.set_up_mm)

    def all(self) -> tuple[Fitted, ...]:
        """Return all drawn errors: of the bar, of balls and of mountings."""
        return tuple(self._fitted[key] for key in sorted(self._fitted, key=lambda key: key[0]))
