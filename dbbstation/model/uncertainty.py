"""How well a model knows where the tool goes, anywhere in the workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.kinematics import position_responses
from dbbstation.model.machine_model import by_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.sources.contract import Motion


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
