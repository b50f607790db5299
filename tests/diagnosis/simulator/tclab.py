"""A heated body of first order as a simulator, for the TCLab recording: its heater is stepped to a half at the first row.

Temperatures are integrated by Heun's method in steps of a row, over their excess above what the body had been.
"""

import numpy as np

from dbbstation.diagnosis.simulator.contract import Simulator

AMBIENT_C = 21.0


class HeatedBody(Simulator):
    def simulate(self, inputs, parameters, ports):
        times, other = inputs["t"].tolist(), (inputs["other"] - AMBIENT_C).tolist()
        excess, gain, tau = parameters["start"] - AMBIENT_C, parameters["gain"], parameters["tau"]
        heat, found = ports.heat, []

        def rate(t, x, z):
            return (gain - x) / tau + heat(t, {"excess": x, "other": z})

        for k, t in enumerate(times):
            found.append(excess)
            if k + 1 < len(times):
                h = times[k + 1] - t
                a = rate(t, excess, other[k])
                excess += 0.5 * h * (a + rate(t + h, excess + h * a, other[k + 1]))
        out = np.array(found)
        return {"temperature": AMBIENT_C + out + ports.sensor(inputs["t"], {"excess": out})}
