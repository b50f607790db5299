"""Compiled loops over poses: strut lengths, forward kinematics, bar sensitivities.

Only arrays go in and out; `kinematics.py` is what the rest of the program calls. Joints have the shape
(m, 6, 3) with m = 1 (the same for every pose) or m = n (one set per pose).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.compiled import compiled

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONVERGED = 0
SINGULAR = 1
TOO_MANY_STEPS = 2


@compiled
def _factorise(a: NDArray[np.float64], order: NDArray[np.int64]) -> bool:
    """LU factors with row exchanges of the 6x6 matrix `a`, in place; False where it is singular."""
    for column in range(6):
        pivot = column
        for row in range(column + 1, 6):
            if abs(a[row, column]) > abs(a[pivot, column]):
                pivot = row
        order[column] = pivot
        if not abs(a[pivot, column]) > 1e-12:  # NaN counts as singular too  # noqa: PLR2004
            return False
        if pivot != column:
            for k in range(6):
                a[column, k], a[pivot, k] = a[pivot, k], a[column, k]
        inverse = 1.0 / a[column, column]
        for row in range(column + 1, 6):
            a[row, column] *= inverse
            for k in range(column + 1, 6):
                a[row, k] -= a[row, column] * a[column, k]
    return True


@compiled
def _substitute(a: NDArray[np.float64], order: NDArray[np.int64], b: NDArray[np.float64]) -> None:
    """Solve with the factors of `_factorise`, in place of the right-hand side `b`."""
    for row in range(6):
        pivot = order[row]
        b[row], b[pivot] = b[pivot], b[row]
    for row in range(6):
        for k in range(row):
            b[row] -= a[row, k] * b[k]
    for row in range(5, -1, -1):
        for k in range(row + 1, 6):
            b[row] -= a[row, k] * b[k]
        b[row] /= a[row, row]


@compiled
def _turn(rotation: NDArray[np.float64], wx: float, wy: float, wz: float) -> None:
    """Turn a rotation matrix by the rotation vector w [rad, machine frame], exactly, in place (Rodrigues)."""
    square = wx * wx + wy * wy + wz * wz
    angle = np.sqrt(square)
    if angle < 1e-4:  # series, exact to machine precision here  # noqa: PLR2004
        s = 1.0 - square / 6.0
        c = 0.5 - square / 24.0
    else:
        s = np.sin(angle) / angle
        c = (1.0 - np.cos(angle)) / square
    m00, m01, m02 = 1.0 - c * (wy * wy + wz * wz), c * wx * wy - s * wz, c * wx * wz + s * wy
    m10, m11, m12 = c * wx * wy + s * wz, 1.0 - c * (wx * wx + wz * wz), c * wy * wz - s * wx
    m20, m21, m22 = c * wx * wz - s * wy, c * wy * wz + s * wx, 1.0 - c * (wx * wx + wy * wy)
    for k in range(3):
        x, y, z = rotation[0, k], rotation[1, k], rotation[2, k]
        rotation[0, k] = m00 * x + m01 * y + m02 * z
        rotation[1, k] = m10 * x + m11 * y + m12 * z
        rotation[2, k] = m20 * x + m21 * y + m22 * z


@compiled
def strut_vectors(
    start: int,
    stop: int,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    base: NDArray[np.float64],
    platform: NDArray[np.float64],
    lengths: NDArray[np.float64],
    units: NDArray[np.float64],
    arms: NDArray[np.float64],
) -> None:
    """Strut lengths, unit vectors from base to platform and arms R P for the poses `start` to `stop`.

    Shapes: position (n, 3), rotation (n, 3, 3), base and platform (m, 6, 3), lengths (n, 6), units and
    arms (n, 6, 3) [mm]. [CAL eq 1]
    """
    for n in range(start, stop):
        q = base[n if base.shape[0] > 1 else 0]
        p = platform[n if platform.shape[0] > 1 else 0]
        r = rotation[n]
        for i in range(6):
            square = 0.0
            for k in range(3):
                arms[n, i, k] = r[k, 0] * p[i, 0] + r[k, 1] * p[i, 1] + r[k, 2] * p[i, 2]
                units[n, i, k] = arms[n, i, k] + position[n, k] - q[i, k]
                square += units[n, i, k] ** 2
            lengths[n, i] = np.sqrt(square)
            for k in range(3):
                units[n, i, k] /= lengths[n, i]


@compiled
def forward(
    start: int,
    stop: int,
    target: NDArray[np.float64],
    base: NDArray[np.float64],
    platform: NDArray[np.float64],
    tolerance: float,
    most_steps: int,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    outcome: NDArray[np.int64],
) -> None:
    """Newton-Raphson on the strut lengths [CAL eq 2], from the poses in `position` and `rotation`, in place.

    Each step solves J (dt, dw) = target - L with the exact Jacobian J = [u, (R P) x u] and turns the
    platform by the rotation vector dw exactly, so convergence is quadratic. `outcome` (n,) says how each
    pose ended.
    """
    jacobian = np.empty((6, 6))
    step = np.empty(6)
    order = np.empty(6, dtype=np.int64)
    for n in range(start, stop):
        q = base[n if base.shape[0] > 1 else 0]
        p = platform[n if platform.shape[0] > 1 else 0]
        r = rotation[n]
        t = position[n]
        outcome[n] = TOO_MANY_STEPS
        for _ in range(most_steps):
            worst = 0.0
            for i in range(6):
                ax = r[0, 0] * p[i, 0] + r[0, 1] * p[i, 1] + r[0, 2] * p[i, 2]
                ay = r[1, 0] * p[i, 0] + r[1, 1] * p[i, 1] + r[1, 2] * p[i, 2]
                az = r[2, 0] * p[i, 0] + r[2, 1] * p[i, 1] + r[2, 2] * p[i, 2]
                sx, sy, sz = ax + t[0] - q[i, 0], ay + t[1] - q[i, 1], az + t[2] - q[i, 2]
                length = np.sqrt(sx * sx + sy * sy + sz * sz)
                inverse = 1.0 / length
                sx, sy, sz = sx * inverse, sy * inverse, sz * inverse
                jacobian[i, 0], jacobian[i, 1], jacobian[i, 2] = sx, sy, sz
                jacobian[i, 3], jacobian[i, 4], jacobian[i, 5] = ay * sz - az * sy, az * sx - ax * sz, ax * sy - ay * sx
                step[i] = target[n, i] - length
                worst = max(worst, abs(step[i]))
            if worst <= tolerance:
                outcome[n] = CONVERGED
                break
            if not _factorise(jacobian, order):
                outcome[n] = SINGULAR
                break
            _substitute(jacobian, order, step)
            for k in range(3):
                t[k] += step[k]
            _turn(r, step[3], step[4], step[5])


@compiled
def adjoint(
    start: int,
    stop: int,
    units: NDArray[np.float64],
    arms: NDArray[np.float64],
    direction: NDArray[np.float64],
    moment: NDArray[np.float64],
    gain: NDArray[np.float64],
    outcome: NDArray[np.int64],
) -> None:
    """Solve J^T g = [direction, moment] for each pose: g (n, 6) is what one unit of strut error does.

    Shapes: units and arms (n, 6, 3), direction and moment (n, 3).
    """
    transposed = np.empty((6, 6))
    order = np.empty(6, dtype=np.int64)
    for n in range(start, stop):
        for i in range(6):
            sx, sy, sz = units[n, i, 0], units[n, i, 1], units[n, i, 2]
            ax, ay, az = arms[n, i, 0], arms[n, i, 1], arms[n, i, 2]
            transposed[0, i], transposed[1, i], transposed[2, i] = sx, sy, sz
            transposed[3, i], transposed[4, i], transposed[5, i] = (
                ay * sz - az * sy,
                az * sx - ax * sz,
                ax * sy - ay * sx,
            )
        for k in range(3):
            gain[n, k] = direction[n, k]
            gain[n, 3 + k] = moment[n, k]
        if not _factorise(transposed, order):
            outcome[n] = SINGULAR
            continue
        _substitute(transposed, order, gain[n])
        outcome[n] = CONVERGED
