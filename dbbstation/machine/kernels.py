"""Compiled loops over poses: forward kinematics and bar sensitivities.

`kinematics.py` is the interface; kernels accept arrays only and compute poses `start` to `stop`. Joints have shape (m,
6, 3), balls (m, 3), with m = 1 or n. Poses are processed in groups of `LANES`, the last axis of work arrays and
innermost loop. Lanes do not branch, so results do not depend on grouping. The last group is filled by repeating its
last pose.

t (3, LANES) and r (3, 3, LANES) are platform positions and rotations, q and p joints of base and platform (6, 3,
LANES); a Jacobian (6, 6, LANES) has rows [u, (R P) x u]. All kernels are in one file because the compiler's cache checks one file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.compiled import compiled, inlined

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers

CONVERGED = 0
SINGULAR = 1
TOO_MANY_STEPS = 2

REUSING = 2
"""Newton step, counted from 0, that reuses the previous Jacobian."""

LANES = 64
"""Poses per group: the fewest whose loops the compiler does not unroll; work arrays still fit the inner caches."""

LOOSE = 1e-20
"""Least squared distance of a matrix column from the span of the previous columns [1 or mm², by column]. Rounding gives
1e-26 at exactly singular poses. A pose just above the limit has a solution, but a useless one."""


@inlined
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined
def _gather(first: int, stop: int, rows: Floats, lanes: Floats) -> None:
    """Gather rows from `first`, shape (n, k), into lanes, shape (k, LANES); a single row fills all lanes."""
    for lane in range(LANES):
        n = min(first + lane, stop - 1, rows.shape[0] - 1)
        for k in range(rows.shape[1]):
            lanes[k, lane] = rows[n, k]


@inlined
def _gather_matrices(first: int, stop: int, rows: Floats, lanes: Floats) -> None:
    """Gather rows of shape (n, i, k) into lanes of shape (i, k, LANES)."""
    for lane in range(LANES):
        n = min(first + lane, stop - 1, rows.shape[0] - 1)
        for i in range(rows.shape[1]):
            for k in range(rows.shape[2]):
                lanes[i, k, lane] = rows[n, i, k]


@inlined
def _gather_machine(
    start: int,
    first: int,
    stop: int,
    position: Floats,
    rotation: Floats,
    base: Floats,
    platform: Floats,
    t: Floats,
    r: Floats,
    q: Floats,
    p: Floats,
) -> None:
    _gather(first, stop, position, t)
    _gather_matrices(first, stop, rotation, r)
    if first == start or base.shape[0] > 1:
        _gather_matrices(first, stop, base, q)
    if first == start or platform.shape[0] > 1:
        _gather_matrices(first, stop, platform, p)


@inlined
def _arm_and_span(
    i: int,
    lane: int,
    t: Floats,
    r: Floats,
    q: Floats,
    p: Floats,
) -> tuple[float, float, float, float, float, float]:
    """Return arm R P and vector R P + t - Q of strut i [CAL eq 1]."""
    px, py, pz = p[i, 0, lane], p[i, 1, lane], p[i, 2, lane]
    ax = r[0, 0, lane] * px + r[0, 1, lane] * py + r[0, 2, lane] * pz
    ay = r[1, 0, lane] * px + r[1, 1, lane] * py + r[1, 2, lane] * pz
    az = r[2, 0, lane] * px + r[2, 1, lane] * py + r[2, 2, lane] * pz
    return ax, ay, az, ax + t[0, lane] - q[i, 0, lane], ay + t[1, lane] - q[i, 1, lane], az + t[2, lane] - q[i, 2, lane]


@inlined
def _lengths(
    t: Floats,
    r: Floats,
    q: Floats,
    p: Floats,
    length: Floats,
) -> None:
    """Compute strut lengths, shape (6, LANES)."""
    for i in range(6):
        for lane in range(LANES):
            _, _, _, sx, sy, sz = _arm_and_span(i, lane, t, r, q, p)
            length[i, lane] = np.sqrt(sx * sx + sy * sy + sz * sz)


@inlined
def _struts(
    t: Floats,
    r: Floats,
    q: Floats,
    p: Floats,
    length: Floats,
    arm: Floats,
    jacobian: Floats,
) -> None:
    """Compute strut lengths (6, LANES), arms (6, 3, LANES) and the Jacobian (6, 6, LANES)."""
    for i in range(6):
        for lane in range(LANES):
            ax, ay, az, sx, sy, sz = _arm_and_span(i, lane, t, r, q, p)
            distance = np.sqrt(sx * sx + sy * sy + sz * sz)
            inverse = 1.0 / distance
            ux, uy, uz = sx * inverse, sy * inverse, sz * inverse
            length[i, lane] = distance
            arm[i, 0, lane], arm[i, 1, lane], arm[i, 2, lane] = ax, ay, az
            jacobian[i, 0, lane], jacobian[i, 1, lane], jacobian[i, 2, lane] = ux, uy, uz
            jacobian[i, 3, lane], jacobian[i, 4, lane], jacobian[i, 5, lane] = _cross(ax, ay, az, ux, uy, uz)


@inlined
def _orthogonalise(matrix: Floats, triangle: Floats, sound: Floats) -> None:
    """Orthogonalise columns of a matrix, shape (6, 6, LANES), in place by modified Gram-Schmidt."""
    # With the right-hand side as a further column (`_substitute`), this is equivalent to Householder's method: as
    # stable as pivoted elimination, but without row exchanges. [Björck, BIT 7 (1967) 1-21; Björck and Paige, SIAM J.
    # Matrix Anal. Appl. 13 (1992) 176-190]
    for k in range(6):
        for lane in range(LANES):
            square = 0.0
            for i in range(6):
                square += matrix[i, k, lane] * matrix[i, k, lane]
            triangle[k, k, lane] = 1.0 / square
            sound[lane] = (1.0 if k == 0 else sound[lane]) if square > LOOSE else 0.0
        for j in range(k + 1, 6):
            for lane in range(LANES):
                along = 0.0
                for i in range(6):
                    along += matrix[i, k, lane] * matrix[i, j, lane]
                along *= triangle[k, k, lane]
                triangle[k, j, lane] = along
                for i in range(6):
                    matrix[i, j, lane] -= along * matrix[i, k, lane]


@inlined
def _substitute(
    matrix: Floats,
    triangle: Floats,
    right: Floats,
    solution: Floats,
) -> None:
    """Solve after `_orthogonalise`; the right-hand side, shape (6, LANES), is overwritten."""
    for k in range(6):
        for lane in range(LANES):
            along = 0.0
            for i in range(6):
                along += matrix[i, k, lane] * right[i, lane]
            along *= triangle[k, k, lane]
            solution[k, lane] = along
            for i in range(6):
                right[i, lane] -= along * matrix[i, k, lane]
    for k in range(4, -1, -1):
        for j in range(k + 1, 6):
            for lane in range(LANES):
                solution[k, lane] -= triangle[k, j, lane] * solution[j, lane]


@inlined
def _compare(
    wanted: Floats,
    length: Floats,
    tolerance: float,
    residual: Floats,
    square: Floats,
    state: Integers,
) -> int:
    """Set the residual to target minus present lengths, (6, LANES); return the number of unconverged lanes."""
    for lane in range(LANES):
        square[lane] = 0.0
    for i in range(6):
        for lane in range(LANES):
            missing = wanted[i, lane] - length[i, lane]
            residual[i, lane] = missing
            square[lane] += missing * missing
    searching = 0
    for lane in range(LANES):
        if state[lane] == TOO_MANY_STEPS and square[lane] <= tolerance * tolerance:
            state[lane] = CONVERGED
        searching += 1 if state[lane] == TOO_MANY_STEPS else 0
    return searching


@inlined
def _newton(
    reuse: bool,  # noqa: FBT001 - compiled kernels take no keywords
    matrix: Floats,
    triangle: Floats,
    residual: Floats,
    step: Floats,
    sound: Floats,
    state: Integers,
) -> None:
    if not reuse:
        _orthogonalise(matrix, triangle, sound)
        for lane in range(LANES):
            if state[lane] == TOO_MANY_STEPS and sound[lane] == 0.0:
                state[lane] = SINGULAR
    _substitute(matrix, triangle, residual, step)


@inlined
def _move(t: Floats, r: Floats, step: Floats, state: Integers) -> None:
    """Move unconverged platforms by (dt, w), shape (6, LANES) [mm, rad]."""
    # Cayley's matrix 1 + (w^ + w^w^/2) / (1 + |w|²/4) is an exact rotation without sine; its angle is |w| less |w|³/12.
    for lane in range(LANES):
        goes = state[lane] == TOO_MANY_STEPS
        for k in range(3):
            t[k, lane] += step[k, lane] if goes else 0.0
        wx = step[3, lane] if goes else 0.0
        wy = step[4, lane] if goes else 0.0
        wz = step[5, lane] if goes else 0.0
        c = 1.0 / (1.0 + 0.25 * (wx * wx + wy * wy + wz * wz))
        h = 0.5 * c
        m00, m01, m02 = 1.0 - h * (wy * wy + wz * wz), h * wx * wy - c * wz, h * wx * wz + c * wy
        m10, m11, m12 = h * wx * wy + c * wz, 1.0 - h * (wx * wx + wz * wz), h * wy * wz - c * wx
        m20, m21, m22 = h * wx * wz - c * wy, h * wy * wz + c * wx, 1.0 - h * (wx * wx + wy * wy)
        for k in range(3):
            x, y, z = r[0, k, lane], r[1, k, lane], r[2, k, lane]
            r[0, k, lane] = m00 * x + m01 * y + m02 * z
            r[1, k, lane] = m10 * x + m11 * y + m12 * z
            r[2, k, lane] = m20 * x + m21 * y + m22 * z


@compiled
def forward(
    start: int,
    stop: int,
    target: Floats,
    base: Floats,
    platform: Floats,
    tolerance: float,
    most_steps: int,
    near_position: Floats,
    near_rotation: Floats,
    position: Floats,
    rotation: Floats,
    outcome: Integers,
) -> None:
    """Newton-Raphson on strut lengths [CAL eq 2], from near poses to lengths `target` (n, 6)."""
    # Solving J (dt, w) = target - L with exact Jacobian and rotation converges quadratically; only the third step
    # reuses a Jacobian. `outcome` (n,) is converged if the residual's norm is within `tolerance` [mm].
    t, r, q, p = np.empty((3, LANES)), np.empty((3, 3, LANES)), np.empty((6, 3, LANES)), np.empty((6, 3, LANES))
    length, arm, wanted = np.empty((6, LANES)), np.empty((6, 3, LANES)), np.empty((6, LANES))
    matrix, triangle = np.empty((6, 6, LANES)), np.empty((6, 6, LANES))
    residual, step, square = np.empty((6, LANES)), np.empty((6, LANES)), np.empty(LANES)
    sound, state = np.empty(LANES), np.empty(LANES, dtype=np.int64)
    for first in range(start, stop, LANES):
        _gather_machine(start, first, stop, near_position, near_rotation, base, platform, t, r, q, p)
        _gather(first, stop, target, wanted)
        for lane in range(LANES):
            state[lane] = TOO_MANY_STEPS  # initial value
        for number in range(most_steps):
            reuse = number == REUSING
            if reuse:
                _lengths(t, r, q, p, length)
            else:
                _struts(t, r, q, p, length, arm, matrix)
            if _compare(wanted, length, tolerance, residual, square, state) == 0:
                break
            _newton(reuse, matrix, triangle, residual, step, sound, state)
            _move(t, r, step, state)
        for n in range(first, min(first + LANES, stop)):
            outcome[n] = state[n - first]
            for k in range(3):
                position[n, k] = t[k, n - first]
                for m in range(3):
                    rotation[n, k, m] = r[k, m, n - first]


@compiled
def adjoint(
    start: int,
    stop: int,
    units: Floats,
    arms: Floats,
    direction: Floats,
    moment: Floats,
    gain: Floats,
    outcome: Integers,
) -> None:
    """Solve J^T g = [direction, moment] per pose: g (n, 6) is the effect of one unit of strut error.

    Shapes: units and arms (n, 6, 3), direction and moment (n, 3).
    """
    unit, arm = np.empty((6, 3, LANES)), np.empty((6, 3, LANES))
    force, turning, sound = np.empty((3, LANES)), np.empty((3, LANES)), np.empty(LANES)
    matrix, triangle = np.empty((6, 6, LANES)), np.empty((6, 6, LANES))
    right, g = np.empty((6, LANES)), np.empty((6, LANES))
    for first in range(start, stop, LANES):
        _gather_matrices(first, stop, units, unit)
        _gather_matrices(first, stop, arms, arm)
        _gather(first, stop, direction, force)
        _gather(first, stop, moment, turning)
        for i in range(6):
            for lane in range(LANES):
                ux, uy, uz = unit[i, 0, lane], unit[i, 1, lane], unit[i, 2, lane]
                matrix[0, i, lane], matrix[1, i, lane], matrix[2, i, lane] = ux, uy, uz
                matrix[3, i, lane], matrix[4, i, lane], matrix[5, i, lane] = _cross(
                    arm[i, 0, lane], arm[i, 1, lane], arm[i, 2, lane], ux, uy, uz
                )
        for k in range(3):
            for lane in range(LANES):
                right[k, lane], right[3 + k, lane] = force[k, lane], turning[k, lane]
        _orthogonalise(matrix, triangle, sound)
        _substitute(matrix, triangle, right, g)
        for n in range(first, min(first + LANES, stop)):
            outcome[n] = CONVERGED if sound[n - first] == 1.0 else SINGULAR
            for i in range(6):
                gain[n, i] = g[i, n - first]


@inlined
def _bar_system(
    t: Floats,
    r: Floats,
    ball: Floats,
    tool: Floats,
    jacobian: Floats,
    span: Floats,
    matrix: Floats,
    right: Floats,
) -> None:
    """Return the bar's length, shape (LANES,), and the system J^T g = [n, (R o) x n], n its direction, o the tool ball."""
    for i in range(6):
        for k in range(6):
            for lane in range(LANES):
                matrix[k, i, lane] = jacobian[i, k, lane]
    for lane in range(LANES):
        ox, oy, oz = tool[0, lane], tool[1, lane], tool[2, lane]
        lx = r[0, 0, lane] * ox + r[0, 1, lane] * oy + r[0, 2, lane] * oz
        ly = r[1, 0, lane] * ox + r[1, 1, lane] * oy + r[1, 2, lane] * oz
        lz = r[2, 0, lane] * ox + r[2, 1, lane] * oy + r[2, 2, lane] * oz
        sx = lx + t[0, lane] - ball[0, lane]
        sy = ly + t[1, lane] - ball[1, lane]
        sz = lz + t[2, lane] - ball[2, lane]
        span[lane] = np.sqrt(sx * sx + sy * sy + sz * sz)
        inverse = 1.0 / span[lane]
        nx, ny, nz = sx * inverse, sy * inverse, sz * inverse
        right[0, lane], right[1, lane], right[2, lane] = nx, ny, nz
        right[3, lane], right[4, lane], right[5, lane] = _cross(lx, ly, lz, nx, ny, nz)


@compiled
def bar(
    start: int,
    stop: int,
    position: Floats,
    rotation: Floats,
    base: Floats,
    platform: Floats,
    fixed_ball: Floats,
    tool_ball: Floats,
    lengths: Floats,
    directions: Floats,
    gain: Floats,
    outcome: Integers,
) -> None:
    """Return a bar's length and sensitivities by the adjoint method: one linear solution per pose."""
    # With n from fixed to tool ball and o the tool ball in the platform frame, J^T g = [n, (R o) x n] gives the
    # sensitivity to strut lengths; g_i u_i is the sensitivity to base joint i. Shapes: fixed_ball in the machine frame,
    # tool_ball in the platform frame, lengths (n,), directions (n, 3), gain (n, 24): six struts, then base joints' x,
    # y, z.
    t, r, q, p = np.empty((3, LANES)), np.empty((3, 3, LANES)), np.empty((6, 3, LANES)), np.empty((6, 3, LANES))
    length, arm, jacobian = np.empty((6, LANES)), np.empty((6, 3, LANES)), np.empty((6, 6, LANES))
    matrix, triangle = np.empty((6, 6, LANES)), np.empty((6, 6, LANES))
    right, g = np.empty((6, LANES)), np.empty((6, LANES))
    ball, tool, span, sound = np.empty((3, LANES)), np.empty((3, LANES)), np.empty(LANES), np.empty(LANES)
    for first in range(start, stop, LANES):
        _gather_machine(start, first, stop, position, rotation, base, platform, t, r, q, p)
        _gather(first, stop, fixed_ball, ball)
        _gather(first, stop, tool_ball, tool)
        _struts(t, r, q, p, length, arm, jacobian)
        _bar_system(t, r, ball, tool, jacobian, span, matrix, right)
        for n in range(first, min(first + LANES, stop)):
            lengths[n] = span[n - first]
            for k in range(3):
                directions[n, k] = right[k, n - first]
        _orthogonalise(matrix, triangle, sound)
        _substitute(matrix, triangle, right, g)
        for n in range(first, min(first + LANES, stop)):
            outcome[n] = CONVERGED if sound[n - first] == 1.0 else SINGULAR
            for i in range(6):
                gain[n, i] = g[i, n - first]
                for k in range(3):
                    gain[n, 6 + 3 * i + k] = g[i, n - first] * jacobian[i, k, n - first]
