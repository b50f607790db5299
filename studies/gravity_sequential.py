"""Gravity after the kinematics [GRAV 3.2]: stiffness from two contouring error profiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import CalibrationError
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.model.observation import Observation

MOST_STEPS = 20
AGREED = 1e-6
"""Share of the compliance by which the last step may still move it; the first step leaves parts in a thousand."""


@dataclass(frozen=True)
class Compliance:
    """Compliance of struts of 1000 mm, for K_stiff of [GRAV eq 7].

    Attributes:
        uncertainty_um_kn: standard deviation of the fit.
    """

    um_kn: float
    uncertainty_um_kn: float


def with_gravity(kinematics: MachineModel, um_kn: float) -> MachineModel:
    """Return a model with gravity of this compliance."""
    gravity = Fitted(known_sources()["gravity"], np.array([um_kn]))
    return MachineModel(kinematics.machine, (*kinematics.of_the_machine().sources, gravity))


def compliance_from_profiles(kinematics: MachineModel, runs: Sequence[Observation]) -> Compliance:
    """Fit the compliance to contouring errors of a few circles, kinematics held [GRAV 3.2].

    A profile is the deviation without centre and mean radius; residuals count as noise.

    Args:
        kinematics: without gravity.
        runs: such as conditions A and B.

    Raises:
        CalibrationError: the steps do not settle.
    """
    um_kn, column, left = 0.0, np.zeros(0), np.zeros(0)
    for _ in range(MOST_STEPS):
        model = with_gravity(kinematics, um_kn)
        parts = [_profile(model, run) for run in runs]
        column, left = (np.concatenate(kind) for kind in zip(*parts, strict=True))
        step = float(column @ left / (column @ column))
        um_kn += step
        if abs(step) <= AGREED * abs(um_kn):
            freedom = len(left) - 3 * len(runs) - 1
            return Compliance(um_kn, float(np.sqrt((left @ left) / freedom / (column @ column))))
    raise CalibrationError(
        "the compliance of the struts does not settle",
        remedy="use circles that are tilted by 20 degrees or more: gravity hardly bends others",
    )


def _profile(model: MachineModel, run: Observation) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a profile's derivative by compliance, and measured minus predicted, shape (n,) each."""
    reading = model.bar(run.motion())
    rows = np.column_stack([reading.by_fitted(model.sources[-1])[:, 0], run.raw.length_mm - reading.length_mm])
    theta = np.radians(run.raw.theta_deg)
    circle, _ = np.linalg.qr(np.column_stack([np.cos(theta), np.sin(theta), np.ones(len(theta))]))
    rows -= circle @ (circle.T @ rows)
    return rows[:, 0], rows[:, 1]
