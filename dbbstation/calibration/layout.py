"""Which numbers a fit looks for: every source's parameters, once per set that shares them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.inference.square_root import Columns
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import ErrorSource, Fitted, Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import Motion


@dataclass(frozen=True, eq=False)
class Term:
    """One set of parameters of one source.

    Attributes:
        source: the cause.
        shared: name of the set.
        parameters: what the columns are.
        columns: where they stand in x.
    """

    source: ErrorSource
    shared: str
    parameters: tuple[Parameter, ...]
    columns: slice

    def acts_on(self, motion: Motion) -> bool:
        """Whether a run takes its values from this set."""
        return self.source.shared_by(motion) == self.shared


@dataclass(frozen=True, eq=False)
class Layout:
    """Terms of a fit and what is known of their columns beforehand."""

    machine: Machine
    terms: tuple[Term, ...]
    known: Columns

    @property
    def names(self) -> tuple[tuple[str, str, str], ...]:
        """Source, set and parameter of every column."""
        return tuple((term.source.name, term.shared, p.name) for term in self.terms for p in term.parameters)

    def model(self, x: NDArray[np.float64]) -> MachineModel:
        """Machine model with the values of all columns, shape (k,)."""
        return MachineModel(
            self.machine,
            tuple(Fitted(term.source, x[term.columns], term.shared) for term in self.terms),
        )


def lay_out(machine: Machine, sources: Sequence[ErrorSource], observations: Sequence[Observation]) -> Layout:
    """Give every source the sets that the observations need.

    A set whose size is stated becomes a random effect; one whose stated size is zero does not exist.

    Raises:
        ModelError: a source needs what machine file or recordings lack.
    """
    terms: list[Term] = []
    prior: list[NDArray[np.float64]] = []
    motions = [observation.motion() for observation in observations]
    count = 0
    for source in sources:
        parameters = source.parameters(machine)
        for shared, motion in {source.shared_by(motion): motion for motion in motions}.items():
            source.require(motion)
            stated = source.stated_mm(motion)
            if stated is not None and not np.any(stated > 0.0):
                continue
            terms.append(Term(source, shared, parameters, slice(count, count + len(parameters))))
            prior.append(np.full(len(parameters), np.inf) if stated is None else stated)
            count += len(parameters)
    priors = np.concatenate(prior) if prior else np.zeros(0)
    scale = np.array([p.plausible for term in terms for p in term.parameters])
    return Layout(machine, tuple(terms), Columns(priors, scale, np.isfinite(priors)))
