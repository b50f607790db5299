"""Fit a drive to the EMPS recording by integration, which uses nothing of this program: to hold beside what `drive` says by regression.

    python -m tests.diagnosis.simulator.emps_fit TABLE

Mass times acceleration is the force less friction and an offset, integrated in steps of half a sample, the force held; its errors add up
over 25 s, since nothing holds the position. What was known is the recording alone.
"""

import sys

import numpy as np
from numba import njit
from scipy.optimize import least_squares

ROUNDING_M_S = 1e-4
"""Speed within which Coulomb friction turns."""


@njit
def position(force, step, mass, viscous, offset, x, v, coulomb, asymmetry):
    """Position [m] at each row; viscous friction is larger by `asymmetry` forwards, and less by it backwards [N s/m]."""
    found, half = np.empty(len(force)), 0.5 * step
    for n in range(len(force)):
        found[n] = x
        for _ in range(2):
            a = (
                force[n] - viscous * v - asymmetry * abs(v) - coulomb * v / np.sqrt(v * v + ROUNDING_M_S**2) - offset
            ) / mass
            w = v + half * a
            b = (
                force[n] - viscous * w - asymmetry * abs(w) - coulomb * w / np.sqrt(w * w + ROUNDING_M_S**2) - offset
            ) / mass
            x += 0.5 * half * (v + w)
            v += 0.5 * half * (a + b)
    return found


def fitted(table, start):
    """Numbers from `mass` on that fit best, and what they leave [mm rms]."""
    measured, force = 1e-3 * table["position_mm"], table["force_n"]
    step = float(np.mean(np.diff(table["t_s"])))

    def left(numbers):
        every = np.concatenate([numbers, np.zeros(7 - len(numbers))])
        return 1e3 * (measured - position(force, step, *every))

    found = least_squares(left, start, x_scale=np.maximum(np.abs(start), 0.01))
    return found.x, float(np.sqrt(np.mean(found.fun**2)))


def main(path):
    table = np.genfromtxt(path, delimiter=",", names=True)
    begun = [95.0, 203.0, 0.0, 1e-3 * table["position_mm"][0], 0.0]
    for more in ([], [20.0, -40.0]):
        (mass, viscous, offset, _, _, *rest), left = fitted(table, [*begun, *more])
        friction = f", Coulomb {rest[0]:.2f} N, asymmetry {rest[1]:.1f} N s/m" if rest else ""
        sys.stdout.write(
            f"mass {mass:.2f} kg, viscous {viscous:.1f} N s/m, offset {offset:.2f} N{friction}: {left:.2f} mm rms\n"
        )


if __name__ == "__main__":
    main(sys.argv[1])
