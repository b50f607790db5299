"""Run simulators that read port inputs and return port signals."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.diagnosis.simulator.contract import Simulator
from dbbstation.diagnosis.simulator.ports import SimulationFault

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.ports import Ports

MOST_EXCHANGES = 100
"""Greatest number of iterations until port inputs and signals agree."""

SETTLED = 1e-9
"""Largest relative change of a port input in one iteration after which it has converged. It is far below the response
to a test input, a hundredth of the residual."""

RUNS_AWAY = 1e12
"""Factor of growth of a port input over its first value beyond which the iteration diverges."""


@dataclass(frozen=True, eq=False)
class ExchangedSimulator(Simulator):
    """A simulator with the terms as inputs at its ports.

    Attributes:
        ports: names of the signals by port.
    """

    ports: Mapping[str, tuple[str, ...]]
    outputs: tuple[str, ...]
    limit_s: float

    @property
    @abstractmethod
    def said(self) -> str:
        """Return its name for error messages."""

    @abstractmethod
    def simulate_once(self, columns: Mapping[str, Floats], parameters: Mapping[str, float]) -> Mapping[str, Floats]:
        """Return outputs by name, and signals as `port.signal`, shape (n,), for inputs, also at the ports, shape (n,)."""

    def simulate(
        self, inputs: Mapping[str, Floats], parameters: Mapping[str, float], ports: Ports
    ) -> Mapping[str, Floats]:
        """Simulate until port inputs and signals agree."""
        t = inputs["t"]
        acting = {name: np.zeros(len(t)) for name in self.ports}
        first = 0.0
        for _ in range(MOST_EXCHANGES):
            found = self.simulate_once({**inputs, **acting}, parameters)
            after = {name: self._acts(name, t, found, ports) for name in self.ports}
            size = max((float(np.abs(values).max(initial=0.0)) for values in after.values()), default=0.0)
            change = max((float(np.abs(after[name] - acting[name]).max(initial=0.0)) for name in after), default=0.0)
            first = first or size
            if change <= SETTLED * size:
                return {name: found[name] for name in self.outputs if name in found}
            if not np.isfinite(change) or size > RUNS_AWAY * first:
                return {name: np.full(len(t), np.nan) for name in self.outputs}
            acting = after
        what = f"what acts at the ports and the signals there do not agree after {MOST_EXCHANGES} rounds"
        raise SimulationFault(f"{what}; record fewer rows at a time, or write the simulator as a Python class")

    def _acts(self, name: str, t: Floats, found: Mapping[str, Floats], ports: Ports) -> Floats:
        """Return the input of a port for these signals, shape (n,)."""
        signals = {}
        for signal in self.ports[name]:
            values = found.get(f"{name}.{signal}")
            if values is None or values.shape != t.shape:
                raise SimulationFault(f"its result has no `{name}.{signal}` with {len(t)} rows")
            signals[signal] = values
        if not all(np.isfinite(values).all() for values in signals.values()):
            return np.full(len(t), np.nan)
        return np.broadcast_to(np.asarray(getattr(ports, name)(t, signals), dtype=np.float64), t.shape)
