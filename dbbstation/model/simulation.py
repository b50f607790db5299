"""What a model predicts that a bar would record: whole turns without noise, and the set-up that a plan foresees."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.model.observation import LEAD_IN_STEP_DEG
from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.sources.contract import Motion, Setup

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.model.machine_model import MachineModel
    from dbbstation.plan.circle import Circle
    from dbbstation.plan.plan import PlannedTest


@dataclass(frozen=True, eq=False)
class SimulatedCircle:
    """One turn, shapes (n,).

    Attributes:
        t_s: time since the first sample [s].
        theta_deg: angle from +X towards +Y [deg].
        commanded: poses of the lead-in and the turn, shape (m + n, 6) [mm, deg].
    """

    t_s: NDArray[np.float64]
    theta_deg: NDArray[np.float64]
    length_mm: NDArray[np.float64]
    commanded: NDArray[np.float64]


def simulate_circle(
    model: MachineModel,
    circle: Circle,
    setup: Setup,
    samples: int,
    started_s: float | None = None,
    command: Callable[[Motion], NDArray[np.float64]] | None = None,
) -> SimulatedCircle:
    """Predict the reading along one turn, with the overshoot arc before it as history.

    Args:
        model: machine and measurement effects.
        setup: ball and bar.
        samples: equally spaced over the turn.
        started_s: start of the turn after that of the session [s]; None where the model needs no time.
        command: from the wanted motion to the poses that are commanded instead, shape (n, 6); the same by default.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        ModelError: a source needs temperatures or currents, which a simulation does not have.
    """
    lead_in = np.arange(-circle.overshoot_deg, 0.0, LEAD_IN_STEP_DEG)
    turn = np.linspace(0.0, FULL_TURN_DEG, samples, endpoint=False, dtype=np.float64)
    phi = np.concatenate([lead_in, turn])
    motion = Motion(
        poses=circle.poses(circle.theta_deg(phi)),
        is_path=True,
        kept=slice(len(lead_in), None),
        time_s=None if started_s is None else started_s + phi / circle.turning_deg_s,
        setup=setup,
    )
    if command is not None:
        motion = replace(motion, poses=command(motion), straight=True)
    theta = np.mod(circle.theta_deg(turn), FULL_TURN_DEG)
    return SimulatedCircle(turn / circle.turning_deg_s, theta, model.bar(motion).length_mm, motion.poses)


def setup_of(test: PlannedTest) -> Setup:
    """Return the set-up that a planned test will have when it is mounted once."""
    ball = test.ball
    return Setup(
        session="",
        mounting=test.name,
        ball=ball.name,
        instrument="",
        fixed_ball_mm=np.array(ball.centre_mm),
        mounting_repeatability_mm=ball.repeatability_mm,
        ball_uncertainty_mm=ball.uncertainty_mm,
        bar_uncertainty_mm=0.0,
        plate=ball.plate,
    )
