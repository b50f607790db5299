"""What kinematic errors do to the readings of a plan, by finite differences, and how much of an effect they can hide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.session import true_runs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tests.plant.arrays import FloatArray
    from tests.plant.machine import Machine
    from tests.plant.mechanisms.base import Mechanism
    from tests.plant.plan import Plan

STEP_MM = 0.01
LENGTHS_AND_BASE = 24
WITH_PLATFORM = 42


def readings(
    plan: Plan, mechanisms: Sequence[Mechanism] = (), machine: Machine | None = None, rate_hz: float = 2.0
) -> FloatArray:
    """All samples of all circles one after the other, noise-free [mm] `(m,)`."""
    runs = true_runs(plan, mechanisms, machine, rate_hz)
    return np.concatenate([run.length_mm[run.in_circle] for run in runs])


def kinematic_matrix(plan: Plan, columns: int = LENGTHS_AND_BASE, machine: Machine | None = None) -> FloatArray:
    """`(m, columns)`: readings by six reference lengths, eighteen base and, of 42, eighteen platform coordinates.

    [CAL eq 4] with central differences of two hundredths of a millimetre, whose own error is far below a nanometre.
    """

    def moved(column: int, step_mm: float) -> FloatArray:
        errors_mm = np.zeros(WITH_PLATFORM)
        errors_mm[column] = step_mm
        base_mm, platform_mm = errors_mm[6:24].reshape(6, 3), errors_mm[24:].reshape(6, 3)
        return readings(plan, [Kinematics(errors_mm[:6], base_mm, platform_mm)], machine)

    differences = [moved(column, STEP_MM) - moved(column, -STEP_MM) for column in range(columns)]
    return np.stack(differences, axis=1) / (2 * STEP_MM)


def visible_directions(matrix: FloatArray, floor: float = 1e-6) -> int:
    values = np.linalg.svd(matrix, compute_uv=False)
    return int((values > floor * values[0]).sum())


def left_by(matrix: FloatArray, signature: FloatArray) -> FloatArray:
    """What the visible directions of a matrix `(m, k)` leave of a signature `(m,)`."""
    basis = np.linalg.svd(matrix, full_matrices=False)[0][:, : visible_directions(matrix)]
    return signature - basis @ (basis.T @ signature)


def concealed_share(matrix: FloatArray, signature: FloatArray) -> float:
    """`1 - |r|²/|s|²` with r what the matrix leaves of the signature s."""
    left = left_by(matrix, signature)
    return 1.0 - float(left @ left) / float(signature @ signature)
