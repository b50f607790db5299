"""Forward kinematics per pose against `scipy.optimize.root` per pose.

    python benchmarks/forward_kinematics.py [--json]

The problem is the calibration's: strut lengths of commanded poses on the nominal machine are solved on a machine whose
joints are off by 0.1 mm, starting from the commanded pose, to a residual of 1e-10 mm. Poses are drawn from the
travel that circles use. The peer solves one pose per call, as its interface has it: default method (MINPACK's hybr), a
vectorised residual, the loosest tolerance that brings it to that residual. It solves fewer poses, because each
takes as long as any other. Its residual is written twice: as one writes it with NumPy and SciPy, and with every trick that
spares Python a call, which makes the peer some two times faster. Ours includes everything a caller does: checking,
memory for the answer, threads.
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from dbbstation.files.formats.machine import read_machine
from dbbstation.files.places import shipped_folder
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import forward, strut_lengths

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Hexapod

    Residual = Callable[[NDArray[np.float64], Hexapod, NDArray[np.float64]], NDArray[np.float64]]

POSES = 200_000
PEER_POSES = 300
PEER_CALLS = 5
PEER_TOLERANCE = 1e-10
SEED = 20261121


def main() -> None:
    """Measure and print."""
    nominal = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml").hexapod
    rng = np.random.default_rng(SEED)
    actual = nominal.moved(rng.normal(0.0, 0.1, (6, 3)), rng.normal(0.0, 0.1, (6, 3)))
    poses = rng.uniform([-150, -150, -1180, -15, -15, -4], [150, 150, -860, 15, 15, 4], (POSES, 6))
    commanded = Frames.from_poses(poses, nominal.rotation)
    lengths = strut_lengths(nominal, commanded)

    ours = timed(lambda: forward(actual, lengths, commanded), 15)
    found = forward(actual, lengths, commanded)
    residual = float(np.abs(strut_lengths(actual, found) - lengths).max())

    rows = [
        Row("dbbstation", 1e9 * ours.best_s / POSES, "ns/pose", f"median {1e9 * ours.median_s / POSES:.0f}"),
        Row("  residual", residual, "mm", f"greatest over {POSES:,} poses"),
    ]
    for name, residual_of in (("scipy, NumPy residual", plain_residual), ("scipy, spare residual", spare_residual)):
        rows += peer_rows(name, residual_of, actual, lengths[:PEER_POSES], poses[:PEER_POSES], ours.best_s / POSES)
    show(
        "forward kinematics, joints off by 0.1 mm, from the commanded pose",
        rows,
        f"best of {ours.calls} calls (peers: {PEER_CALLS}) after one that warms up",
    )


def peer_rows(
    name: str,
    residual_of: Residual,
    hexapod: Hexapod,
    lengths: NDArray[np.float64],
    starts: NDArray[np.float64],
    ours_s: float,
) -> list[Row]:
    """Time of `scipy.optimize.root` per pose, what it leaves, and how often ours goes into it."""
    solutions = np.empty_like(starts)

    def solve() -> None:
        for n, start in enumerate(starts):
            found = root(residual_of, start, args=(hexapod, lengths[n]), tol=PEER_TOLERANCE)
            solutions[n] = found.x

    times = timed(solve, PEER_CALLS)
    frames = Frames.from_poses(solutions, hexapod.rotation)
    left = float(np.abs(strut_lengths(hexapod, frames) - lengths).max())
    per_pose = times.best_s / len(starts)
    return [
        Row(name, 1e9 * per_pose, "ns/pose", f"median {1e9 * times.median_s / len(starts):,.0f}"),
        Row("  residual", left, "mm", f"greatest over {len(starts)} poses"),
        Row("  ratio", per_pose / ours_s, "times", "wanted: 1400"),
    ]


def plain_residual(pose: NDArray[np.float64], hexapod: Hexapod, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Present less wanted lengths, as one writes it: all six struts at once, the rotation by SciPy."""
    turn = Rotation.from_euler("XYZ", pose[3:], degrees=True).as_matrix()
    struts = pose[:3] + hexapod.platform_joints_mm @ turn.T - hexapod.base_joints_mm
    return np.asarray(np.linalg.norm(struts, axis=1) - lengths, dtype=np.float64)


def spare_residual(pose: NDArray[np.float64], hexapod: Hexapod, lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """Do the same with every trick that saves Python a call: the rotation written out for single numbers."""
    a, b, c = radians(pose[3]), radians(pose[4]), radians(pose[5])
    sa, ca, sb, cb, sc, cc = sin(a), cos(a), sin(b), cos(b), sin(c), cos(c)
    transposed = np.array(
        (
            (cb * cc, ca * sc + sa * sb * cc, sa * sc - ca * sb * cc),
            (-cb * sc, ca * cc - sa * sb * sc, sa * cc + ca * sb * sc),
            (sb, -sa * cb, ca * cb),
        )
    )
    struts = hexapod.platform_joints_mm @ transposed + (pose[:3] - hexapod.base_joints_mm)
    return np.asarray(np.sqrt((struts * struts).sum(axis=1)) - lengths, dtype=np.float64)


if __name__ == "__main__":
    main()
