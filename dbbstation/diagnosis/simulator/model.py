"""A simulator with its parameters, ports, outputs and recordings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.simulator.terms import Term


@dataclass(frozen=True)
class SimulatorParameter:
    """A parameter that every hypothesis refits.

    Attributes:
        name: unique; initial states end with the run's number, from 1.
        uncertainty: prior standard uncertainty; None if unknown.
        run: from 0; None for all runs.
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
        """Return the parameter's scale: uncertainty, else value."""
        return self.uncertainty or abs(self.value) or 1.0


@dataclass(frozen=True)
class SimulatorPort:
    """A place in the simulator where a term may act.

    Attributes:
        name: as called in `simulate`.
        signals: units by name.
        results: signals that result from the simulation.
    """

    name: str
    unit: str
    signals: Mapping[str, str]
    about: str = ""
    results: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Output:
    """One measured output of the simulated object.

    Attributes:
        filter_s: time constant of a first-order sensor filter of simulated values; 0 for none.
    """

    name: str
    unit: str
    filter_s: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulatorRecording:
    """One recording.

    Attributes:
        inputs: `t` [s] and inputs, shape (n,).
        measured: by output, shape (n,).
    """

    name: str
    inputs: Mapping[str, Floats]
    measured: Mapping[str, Floats]

    def __len__(self) -> int:
        return len(self.inputs["t"])


@dataclass(frozen=True, eq=False)
class Model:
    """A simulator with its recordings."""

    name: str
    parameters: tuple[SimulatorParameter, ...]
    ports: tuple[SimulatorPort, ...]
    outputs: tuple[Output, ...]
    runs: tuple[SimulatorRecording, ...]

    def inverse_information(self, rows: Floats, rcond: float) -> tuple[Floats, Floats]:
        """Return the pseudo-inverse of columns' information in unit noise, shape (m, m), times these norms, shape (m,).

        Args:
            rows: effects of parameters, then of terms, shape (n, m); the stated uncertainties add to them.
        """
        known = [1.0 / p.uncertainty**2 if p.uncertainty else 0.0 for p in self.parameters]
        normal = rows.T @ rows + np.diag([*known, *[0.0] * (rows.shape[1] - len(known))])
        norm = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        return np.linalg.pinv(normal / np.outer(norm, norm), rcond=rcond, hermitian=True), norm

    def of_run(self, run: int, values: Sequence[float]) -> tuple[tuple[str, float], ...]:
        """Return arguments of `simulate` for one run and parameter values, shape (k,)."""
        pairs = zip(self.parameters, values, strict=True)
        return tuple((p.key, float(value)) for p, value in pairs if p.run is None or p.run == run)


@dataclass(frozen=True, eq=False)
class TrialInput:
    """Inputs that are not yet recorded.

    Attributes:
        inputs: `t` [s] and inputs, shape (n,).
    """

    run: int
    about: str
    inputs: Mapping[str, Floats]


@dataclass(frozen=True)
class SimulationRequest:
    """Request of one simulation.

    Attributes:
        trial: other inputs, or None.
    """

    run: int
    parameters: tuple[tuple[str, float], ...]
    terms: tuple[Term, ...] = ()
    records: bool = False
    trial: TrialInput | None = None


@dataclass(frozen=True, eq=False)
class SimulationOutcome:
    """The outcome of one simulation.

    Attributes:
        outputs: in the model's order, shape (o, n); not finite if it diverged.
        signals: by port and name with `t`, if requested, shape (calls,).
    """

    outputs: Floats
    signals: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)
