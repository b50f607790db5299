"""Predict recordings of whole turns without noise, for the planned set-up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.model.observation import LEAD_IN_STEP_DEG
from dbbstation.sources.contract import Motion, Setup

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.arrays import Floats
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.plan.plan import Circle, PlannedTest


@dataclass(frozen=True, eq=False)
class SimulatedCircle:
    """One turn, shapes (n,).

    Attributes:
        commanded: lead-in and turn, shape (m + n, 6) [mm, deg].
    """

    t_s: Floats
    theta_deg: Floats
    length_mm: Floats
    commanded: Floats


def simulate_circle(
    model: MachineModel,
    circle: Circle,
    setup: Setup,
    samples: int,
    started_s: float | None = None,
    command: Callable[[Motion], Floats] | None = None,
) -> SimulatedCircle:
    """Predict the reading along one turn with lead-in.

    Args:
        started_s: after the session's start; None if not needed.
        command: function from wanted motion to commands, shape (n, 6); None if equal.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        ModelError: a source needs temperatures or currents.
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
    """Return a planned test's set-up with one mounting."""
    ball = replace(test.ball, place_known=True)
    return Setup.on(ball, session="", mounting=test.name, instrument="", bar_uncertainty_mm=0.0)
