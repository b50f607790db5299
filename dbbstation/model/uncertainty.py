"""How well a model knows where the tool goes, anywhere in the workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import KinematicsError
from dbbstation.machine.kinematics import position_responses
from dbbstation.model.machine_model import by_parameters
from dbbstation.sources.contract import Motion

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.model.identified import IdentifiedModel


def position_uncertainty_mm(identified: IdentifiedModel, motion: Motion) -> NDArray[np.float64]:
    """Standard uncertainty of the predicted X, Y and Z at the rows that count, shape (n, 3) [mm].

    First-order propagation of the identified covariance. Directions that were held at nominal add nothing: what they
    would do stands in the model's `directions_lost`.

    Raises:
        KinematicsError: names the first pose that the actual machine cannot take.
        ModelError: a source needs what the motion does not give.
    """
    model = identified.model.of_the_machine()
    actual = model.actual(motion)
    row_of = {row: k for k, row in enumerate(identified.covariance_rows)}
    responses = position_responses(actual.hexapod, actual.frames)
    count = len(motion.poses[motion.kept])
    sensitivity = np.zeros((3, count, len(row_of)))
    for fitted in model.acting(motion):
        derivative = actual.derivative(fitted)
        names = [(fitted.source.name, fitted.shared, p.name) for p in fitted.source.parameters(model.machine)]
        columns = [row_of[name] for name in names if name in row_of]
        known = [k for k, name in enumerate(names) if name in row_of]
        for axis, response in enumerate(responses):
            whole = np.broadcast_to(by_parameters(derivative, response, motion.kept), (count, len(names)))
            sensitivity[axis][:, columns] = whole[:, known]
    variance = np.einsum("aij,jk,aik->ia", sensitivity, identified.covariance, sensitivity)
    return np.sqrt(np.maximum(variance, 0.0))


POSES_AT_ONCE = 5_000
"""Poses that are predicted together: sensitivities of so many take some megabytes, and progress shows."""


def predicted_poses(
    identified: IdentifiedModel,
    poses: NDArray[np.float64],
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the actual poses for commanded ones, each by itself, and how well their positions are known.

    Args:
        identified: model with its covariance.
        poses: commanded, shape (n, 6) [mm, deg].
        progress: told how many of how many are done.

    Returns:
        Actual poses, shape (n, 6) [mm, deg], and standard uncertainties of X, Y and Z, shape (n, 3) [mm].

    Raises:
        KinematicsError: names a pose that the actual machine cannot take.
        ModelError: a source needs more than poses.
    """
    actual, known = np.empty_like(poses), np.empty((len(poses), 3))
    model = identified.model.of_the_machine()
    for first in range(0, len(poses), POSES_AT_ONCE):
        progress(first, len(poses))
        some = slice(first, first + POSES_AT_ONCE)
        motion = Motion(poses[some])
        try:
            actual[some] = model.actual_poses(motion)
        except KinematicsError:
            model.actual_poses(Motion(poses))  # fails as well, and counts the pose among all
            raise
        known[some] = position_uncertainty_mm(identified, motion)
    progress(len(poses), len(poses))
    return actual, known
