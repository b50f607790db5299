"""The interface of a simulator, and a single simulation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.grouped import grouped
from dbbstation.diagnosis.simulator.model import SimulationOutcome
from dbbstation.diagnosis.simulator.ports import Ports, SimulationFault
from dbbstation.diagnosis.simulator.terms import evaluator
from dbbstation.laws.memory import lagging

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.model import Model, SimulationRequest


class Simulator(ABC):
    """A simulator; instances have no state between runs."""

    @abstractmethod
    def simulate(
        self, inputs: Mapping[str, Floats], parameters: Mapping[str, float], ports: Ports
    ) -> Mapping[str, Floats]:
        """Return outputs at recording times, shape (n,), in their units.

        Call `ports.NAME(t, signals)` at every step and add its value, which is zero unless a term is tried. Steps may
        be repeated or reversed.

        Args:
            inputs: `t` [s] and the inputs by name, shape (n,).
            parameters: parameters and initial states, by name.
        """


def simulated(simulator: Simulator, model: Model, ask: SimulationRequest) -> SimulationOutcome:
    """Run a simulator once.

    Raises:
        SimulationFault: outputs do not match the model.
        Exception: raised by the simulator.
    """
    ports = Ports(model.ports, grouped((term.port, evaluator(term)) for term in ask.terms), records=ask.records)
    run = model.runs[ask.run]
    with np.errstate(all="ignore"):
        try:
            inputs = run.inputs if ask.trial is None else ask.trial.inputs
            outputs = simulator.simulate(dict(inputs), dict(ask.parameters), ports)
        except (ArithmeticError, ValueError) as error:
            if isinstance(error, ValueError) and "math" not in str(error):
                raise
            # Overflow, or functions of infinity: the simulation diverged.
            return SimulationOutcome(np.full((len(model.outputs), len(run)), np.nan))
    found = np.empty((len(model.outputs), len(run)))
    for k, output in enumerate(model.outputs):
        if output.name not in outputs:
            raise SimulationFault(f"`simulate` returns no output `{output.name}`")
        values = np.asarray(outputs[output.name], dtype=np.float64)
        if values.shape != (len(run),):
            raise SimulationFault(f"output `{output.name}` has the shape {values.shape}, {len(run)} rows are expected")
        finite = output.filter_s > 0.0 and bool(np.isfinite(values).all())
        found[k] = values + lagging(values, run.inputs["t"], output.filter_s) if finite else values
    return SimulationOutcome(found, ports.recorded() if ask.records else {})
