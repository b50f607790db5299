"""A tank that empties, by Euler steps from row to row."""

import numpy as np

from dbbstation.diagnosis.simulator.contract import Simulator


class Decay(Simulator):
    """The level falls by rate times level; the port `flow` adds."""

    def simulate(self, inputs, parameters, ports):
        t, level, found = inputs["t"], 1.0, []
        for k, now in enumerate(t):
            found.append(level)
            step = t[min(k + 1, len(t) - 1)] - now
            level += step * (ports.flow(now, {"level": level}) - parameters["rate"] * level)
        return {"level": np.array(found)}
