"""Forward kinematics per pose against `scipy.optimize.root` per pose.

    python benchmarks/forward_kinematics.py [--json]

The problem is the calibration's: strut lengths of commanded poses on the nominal machine are solved on a machine whose
joints are off by 0.1 mm, starting from the commanded pose, to a residual of 1e-10 mm. Poses are drawn from the
travel that circles use. The peer solves one pose per call, as its interface has it: default method (MINPACK's hybr), a
vectorised residual without waste, a tolerance that brings it to the same residual. It solves fewer poses, because each
takes as long as any other. Both include everything a caller has to do, from poses as rotation matrices or angles to
poses as such.
"""

from __future__ import annotations

from math import cos, radians, sin
from typing import TYPE_CHECKING

from benchmarks.measuring import Row, show, timed  # isort: skip - sets up the environment

import numpy as np
from scipy.optimize import root

from dbbstation.files.machine_file import read_machine
from dbbstation.files.shipped import shipped_folder
from dbbstation.machine.kinematics import forward, strut_lengths
from dbbstation.machine.rotation import Frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Hexapod

POSES = 200_000
PEER_POSES = 300
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

    solutions = np.empty((PEER_POSES, 6))

    def peer() -> None:
        for n in range(PEER_POSES):
            solutions[n] = solved_by_scipy(actual, lengths[n], poses[n])

    theirs = timed(peer, 5)
    there = Frames.from_poses(solutions, actual.rotation)
    peer_residual = float(np.abs(strut_lengths(actual, there) - lengths[:PEER_POSES]).max())
    apart = float(np.abs(there.position_mm - found.position_mm[:PEER_POSES]).max())

    ours_ns, theirs_ns = 1e9 * ours.best_s / POSES, 1e9 * theirs.best_s / PEER_POSES
    show(
        "forward kinematics, joints off by 0.1 mm, from the commanded pose",
        [
            Row("dbbstation", ours_ns, "ns/pose", f"median {1e9 * ours.median_s / POSES:.0f}, {POSES:,} poses"),
            Row("  residual", residual, "mm", "greatest over poses and struts"),
            Row("scipy.optimize.root", theirs_ns, "ns/pose", f"median {1e9 * theirs.median_s / PEER_POSES:,.0f}"),
            Row("  residual", peer_residual, "mm", f"{PEER_POSES} poses"),
            Row("  positions apart", apart, "mm"),
            Row("ratio", theirs_ns / ours_ns, "times", "wanted: 1400"),
        ],
        f"best of {ours.calls} calls (peer: {theirs.calls}) after one that warms up",
    )


def solved_by_scipy(hexapod: Hexapod, lengths: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose [mm, deg] with these strut lengths, for the convention Rx(A) Ry(B) Rz(C)."""
    base, platform = hexapod.base_joints_mm, hexapod.platform_joints_mm

    def residual(pose: NDArray[np.float64]) -> NDArray[np.float64]:
        a, b, c = radians(pose[3]), radians(pose[4]), radians(pose[5])
        sa, ca, sb, cb, sc, cc = sin(a), cos(a), sin(b), cos(b), sin(c), cos(c)
        transposed = np.array(
            (
                (cb * cc, ca * sc + sa * sb * cc, sa * sc - ca * sb * cc),
                (-cb * sc, ca * cc - sa * sb * sc, sa * cc + ca * sb * sc),
                (sb, -sa * cb, ca * cb),
            )
        )
        struts = platform @ transposed + (pose[:3] - base)
        return np.sqrt((struts * struts).sum(axis=1)) - lengths

    solution = root(residual, start, tol=1e-13)
    return np.asarray(solution.x, dtype=np.float64)


if __name__ == "__main__":
    main()
