"""A linear oscillator as a simulator, for the Silverbox recording: m a + d v + k x = u, all per volt of input.

The input has energy up to half of the sampling rate. Between samples it is taken as band-limited: interpolated by its Fourier
transform at quarters of a sample, and integrated by Runge and Kutta's method in steps of half a sample.
"""

import numpy as np
from scipy.signal import resample

from dbbstation.diagnosis.simulator.contract import Simulator


class Silverbox(Simulator):
    def simulate(self, inputs, parameters, ports):
        t, u = inputs["t"], inputs["input"]
        h = (t[-1] - t[0]) / (len(t) - 1)
        fine = resample(u, 4 * len(u)).tolist()
        m, d, k = parameters["mass"] * 1e-6, parameters["damping"] * 1e-4, parameters["stiffness"]
        # Speeds are given in thousands per second, so that numbers are of one size.
        x, v = parameters["position"], parameters["speed"] * 1e3
        force, t0, out, h = ports.force, float(t[0]), [], 0.5 * float(h)

        def rate(at, x, v, u):
            return (u - d * v - k * x + force(at, {"position": x, "speed": v * 1e-3})) / m

        for n in range(len(t)):
            out.append(x)
            for half in (0, 1):
                at, p = t0 + (2 * n + half) * h, 4 * n + 2 * half
                u0, u1, u2 = fine[p], fine[p + 1], fine[p + 2] if p + 2 < len(fine) else fine[p + 1]
                a1 = rate(at, x, v, u0)
                v2 = v + 0.5 * h * a1
                a2 = rate(at + 0.5 * h, x + 0.5 * h * v, v2, u1)
                v3 = v + 0.5 * h * a2
                a3 = rate(at + 0.5 * h, x + 0.5 * h * v2, v3, u1)
                v4 = v + h * a3
                a4 = rate(at + h, x + h * v3, v4, u2)
                x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
                v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        return {"position": np.array(out) + parameters["offset"]}
