"""Sensitivities of the bar reading by the adjoint against 24 right-hand sides.

    python benchmarks/sensitivities.py [--json]

The matrix of a calibration: how the reading at 54,000 poses (fifteen circles) answers to six strut lengths and the
eighteen coordinates of the base joints. The plain way solves J dx = b for each of the 24 parameters and projects the
pose changes on the bar. The peer does so with NumPy for all poses and right-hand sides in one call; J and the
right-hand sides are handed to it ready-made, and only solution and projection are timed. The adjoint solves one system
per pose; its time includes the kinematics, the Jacobian and writing the matrix.
"""

from __future__ import annotations

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

import numpy as np

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import bar_sensitivity, inverse, strut_jacobian

POSES = 54_000
SEED = 20261121
BALL_MM = np.array([20.0, -35.0, -1010.0])
TOOL_BALL_MM = np.array([0.0, 0.0, 40.0])


def main() -> None:
    """Measure and print."""
    hexapod = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml").hexapod
    rng = np.random.default_rng(SEED)
    poses = rng.uniform([-150, -150, -1180, -15, -15, -4], [150, 150, -860, 15, 15, 4], (POSES, 6))
    frames = Frames.from_poses(poses, hexapod.rotation)

    ours = timed(lambda: bar_sensitivity(hexapod, frames, BALL_MM, TOOL_BALL_MM), 15)
    adjoint = bar_sensitivity(hexapod, frames, BALL_MM, TOOL_BALL_MM).response.per_parameter

    struts = inverse(hexapod, frames)
    jacobian = strut_jacobian(struts)
    right = np.zeros((POSES, 6, 24))
    right[:, :, :6] = np.eye(6)
    for i in range(6):
        right[:, i, 6 + 3 * i : 9 + 3 * i] = struts.unit[:, i]
    lever = frames.rotation @ TOOL_BALL_MM
    span = frames.position_mm + lever - BALL_MM
    direction = span / np.linalg.norm(span, axis=1, keepdims=True)
    projection = np.concatenate([direction, np.cross(lever, direction)], axis=1)[:, None, :]

    def peer() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        return (projection @ np.linalg.solve(jacobian, right))[:, 0, :]

    theirs = timed(peer, 5)
    apart = float(np.abs(peer() - adjoint).max())
    show(
        f"sensitivities, {POSES:,} poses x 24 parameters",
        [
            Row("dbbstation, adjoint", 1e3 * ours.best_s, "ms", f"median {1e3 * ours.median_s:.2f}"),
            Row("NumPy, 24 right-hand sides", 1e3 * theirs.best_s, "ms", f"median {1e3 * theirs.median_s:.0f}"),
            Row("  greatest difference", apart, "mm/mm"),
            Row("ratio", theirs.best_s / ours.best_s, "times", "wanted: 10"),
        ],
        f"best of {ours.calls} calls (peer: {theirs.calls}) after one that warms up",
    )


if __name__ == "__main__":
    main()
