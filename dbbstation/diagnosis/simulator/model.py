"""What is known of a simulator and its recordings: parameters, ports, outputs, runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from dbbstation.diagnosis.simulator.terms import Term


@dataclass(frozen=True)
class SimulatorParameter:
    """A number of the simulator that is fitted anew with every hypothesis.

    Attributes:
        name: unique; that of an initial state has the number of its run, from 1, where there are several.
        unit: of it; empty where none is stated.
        uncertainty: standard uncertainty to which it was known before; None: nothing was known.
        run: number of the only run that it is of, from 0; None: of all runs.
    """

    name: str
    key: str
    value: float
    unit: str = ""
    uncertainty: float | None = None
    low: float = -np.inf
    high: float = np.inf
    run: int | None = None

    @property
    def size(self) -> float:
        """About how far it may move: its uncertainty, or its value."""
        return self.uncertainty or abs(self.value) or 1.0


@dataclass(frozen=True)
class SimulatorPort:
    """A place of the simulator where something may act.

    Attributes:
        name: by which `simulate` calls it.
        signals: that are known there, unit by name.
    """

    name: str
    unit: str
    signals: Mapping[str, str]
    about: str = ""


@dataclass(frozen=True)
class Output:
    """What is measured of the simulated object.

    Attributes:
        filter_s: time constant of the sensor's first-order filter, which the simulated values pass; 0: none [s].
    """

    name: str
    unit: str
    filter_s: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulatorRecording:
    """One recording.

    Attributes:
        inputs: `t` [s], and inputs by name, shape (n,).
        measured: outputs by name, shape (n,).
    """

    name: str
    inputs: Mapping[str, NDArray[np.float64]]
    measured: Mapping[str, NDArray[np.float64]]

    def __len__(self) -> int:
        return len(self.inputs["t"])


@dataclass(frozen=True, eq=False)
class Model:
    """A simulator with its recordings.

    Attributes:
        parameters: initial states of each run included.
        ports: where something may act.
    """

    name: str
    parameters: tuple[SimulatorParameter, ...]
    ports: tuple[SimulatorPort, ...]
    outputs: tuple[Output, ...]
    runs: tuple[SimulatorRecording, ...]

    def of_run(self, run: int, values: Sequence[float]) -> tuple[tuple[str, float], ...]:
        """What `simulate` is given of values of all parameters, shape (k,), in one run."""
        pairs = zip(self.parameters, values, strict=True)
        return tuple((p.key, float(value)) for p, value in pairs if p.run is None or p.run == run)


@dataclass(frozen=True, eq=False)
class TrialInput:
    """Inputs that nobody recorded yet.

    Attributes:
        inputs: `t` [s], and inputs by name, shape (n,).
    """

    run: int
    about: str
    inputs: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class SimulationRequest:
    """One simulation.

    Attributes:
        run: number of the recording whose inputs it takes.
        terms: what acts at the ports.
        records: whether signals at the ports are wanted.
        trial: inputs that it takes in place of those of the recording; None: it takes these.
    """

    run: int
    parameters: tuple[tuple[str, float], ...]
    terms: tuple[Term, ...] = ()
    records: bool = False
    trial: TrialInput | None = None


@dataclass(frozen=True, eq=False)
class SimulationOutcome:
    """What came of one simulation.

    Attributes:
        outputs: in the order of the model, shape (o, n); not finite where the simulation ran away.
        signals: at each port, by its name and theirs, `t` among them, where they were asked for, shape (calls,).
    """

    outputs: NDArray[np.float64]
    signals: Mapping[str, Mapping[str, NDArray[np.float64]]] = field(default_factory=dict)
