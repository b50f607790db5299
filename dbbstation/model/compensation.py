"""Inversion of a machine model: what to command so that the tool goes where it should."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.machine.kinematics import forward, strut_lengths
from dbbstation.machine.rotation import Frames
from dbbstation.model.machine_model import Actual, MachineModel, actual_hexapod

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.sources.contract import Motion

MOST_ROUNDS = 1000
"""A pose-dependent error needs three or four; play hands its correction on from sample to sample, some tens."""
AGREED_MM = 1e-10
PASSED_ON_MM = 1e-5
"""What friction and play may still hand to and fro between samples when the rounds are over: ten nanometres."""


def compensated(model: MachineModel, wanted: Motion) -> NDArray[np.float64]:
    """Poses to command so that the actual machine goes to the wanted ones, in six degrees of freedom.

    The controller drives the struts to F(T; nominal). The actual machine needs F(T wanted; actual) less what the
    error sources add, so the command is the pose at which the nominal machine has those lengths. Weights pull where
    the machine will be, at the wanted poses. All other sources act on what is commanded, hence the rounds: where they
    hang on the pose, each shrinks the remainder by the ratio of error to travel, about 1e-4; where they do not, the
    first rounds are exact.

    Args:
        model: calibrated model; only what belongs to the machine is inverted.
        wanted: poses that the tool tip should take, all rows.

    Returns:
        Poses, shape (n, 6) [mm, deg], for all rows of `wanted`.

    Raises:
        KinematicsError: a pose that the machine cannot take.
        ModelError: a source needs what the motion does not give, or the rounds do not agree.
    """
    own = model.of_the_machine()
    nominal, convention = model.machine.hexapod, model.machine.hexapod.rotation
    target = Frames.from_poses(wanted.poses, convention)
    commanded, last, change = wanted.poses, np.full((len(wanted), 6), np.inf), np.inf
    there: Actual | None = None
    for _ in range(MOST_ROUNDS):
        motion = replace(wanted, poses=commanded)
        effect = own.effect(motion, there)
        platform = target
        if effect.tool_tip_mm is not None:
            tip = np.broadcast_to(effect.tool_tip_mm, (len(target), 3))
            platform = replace(target, position_mm=target.position_mm - np.einsum("nij,nj->ni", target.rotation, tip))
        there = Actual(own, motion, actual_hexapod(nominal, effect), platform, effect)
        needed = strut_lengths(there.hexapod, platform)
        strut = 0.0 if effect.strut_mm is None else effect.strut_mm
        driven = needed - strut + model.machine.reference_length_error_mm
        change = float(np.abs(driven - last).max())
        if change < AGREED_MM:
            return commanded
        commanded = forward(nominal, driven, target).to_poses(convention)
        last = driven
    if change < PASSED_ON_MM:
        return commanded
    raise ModelError(
        f"the compensation does not settle: {change:.2e} mm after {MOST_ROUNDS} rounds",
        remedy="check the model's sources for an effect as large as the motion itself",
    )


def shifted(model: MachineModel, wanted: Motion) -> NDArray[np.float64]:
    """Poses shifted by minus the predicted position error, tilt left alone [GRAV 4.1], shape (n, 6) [mm, deg].

    Kept for comparison with the published compensation: it is first order in the error and leaves the
    orientation wrong.
    """
    error = model.of_the_machine().actual_poses(replace(wanted, kept=slice(None))) - wanted.poses
    poses = wanted.poses.copy()
    poses[:, :3] -= error[:, :3]
    return poses
