"""The Silverbox recording fitted directly, without this package: m a + d v + k x + k3 x³ = u, and an offset of the output.

`python -m tests.diagnosis.simulator.silverbox_fit TABLE` prints what comes of each way to take the input between samples. Steps of half a
sample by Runge and Kutta's method.
"""

import sys

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.signal import resample

BEGUN = (5.4, 2.3, 1.0, 3.9, 0.155, -0.03, 0.0)
"""Mass [µs²], damping [0.1 ms], stiffness, cubic coefficient [1/V²], position [V], speed [kV/s] and offset [V]."""


def quarters(u, way):
    """Input at quarters of a sample, shape (4 n - 3,)."""
    at, rows = np.arange(4 * len(u) - 3) / 4.0, np.arange(len(u))
    if way == "band-limited":
        return resample(u, 4 * len(u))[: len(at)]
    if way == "cubic splines":
        return CubicSpline(rows, u)(at)
    return np.interp(at, rows, u)


def oscillation(numbers, fine, step, *, held):
    """Output [V] at the samples; a held input keeps the value of the sample before for a whole sample."""
    m, d, k, k3, x, v, offset = numbers
    m, d, v, h, out = m * 1e-6, d * 1e-4, v * 1e3, 0.5 * step, []
    rows = (len(fine) + 3) // 4
    for n in range(rows):
        out.append(x + offset)
        for first in (4 * n, 4 * n + 2) if n + 1 < rows else ():
            u0, u1, u2 = (fine[4 * n],) * 3 if held else fine[first : first + 3]
            a1 = (u0 - d * v - (k + k3 * x * x) * x) / m
            x2, v2 = x + 0.5 * h * v, v + 0.5 * h * a1
            a2 = (u1 - d * v2 - (k + k3 * x2 * x2) * x2) / m
            x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
            a3 = (u1 - d * v3 - (k + k3 * x3 * x3) * x3) / m
            x4, v4 = x + h * v3, v + h * a3
            a4 = (u2 - d * v4 - (k + k3 * x4 * x4) * x4) / m
            x, v = x + h / 6.0 * (v + 2.0 * (v2 + v3) + v4), v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
    return np.array(out)


def fitted(t, u, y, way):
    """Root mean square of the residual [V], and the numbers."""
    fine, step = quarters(u, way).tolist(), float(t[-1] - t[0]) / (len(t) - 1)

    def left(numbers):
        return oscillation(numbers, fine, step, held=way == "held") - y

    found = least_squares(left, BEGUN, x_scale=np.maximum(np.abs(BEGUN), 0.05))
    return float(np.sqrt(np.mean(found.fun**2))), found.x


if __name__ == "__main__":
    table = np.loadtxt(sys.argv[1], delimiter=",", skiprows=1).T
    for way in ("band-limited", "cubic splines", "straight lines", "held"):
        rms, numbers = fitted(*table, way)
        line = f"{way:15s} left {1e3 * rms:.3f} mV, stiffness {numbers[2]:.4f}, cubic {numbers[3]:.4f}\n"
        sys.stdout.write(line)
