"""Columns of a fit: each source's parameters, once per group of runs that share values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.inference.square_root import Columns
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Motions
from dbbstation.sources.contract import ErrorSource, Fitted, Need, Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation
    from dbbstation.sources.contract import Motion


HELD = 1e-9
"""Relative prior standard deviation of a parameter held at a limit of its range."""

GEOMETRY = frozenset({"strut-reference-length", "base-joints"})
"""Sources of joint places and strut lengths, which have no formula error. The formula uncertainty that they state
applies to changes between sessions."""


@dataclass(frozen=True, eq=False)
class ParameterSet:
    """The parameters of one source for one group of runs."""

    source: ErrorSource
    shared: str
    parameters: tuple[Parameter, ...]
    columns: slice

    def acts_on(self, motion: Motion) -> bool:
        """Return whether this set applies to a run."""
        return self.source.shared_by(motion) == self.shared and not self.source.of_currents

    def fitted(self, x: Floats) -> Fitted:
        """Return the source with its values from x, shape (k,)."""
        return Fitted(self.source, x[self.columns], self.shared)


@dataclass(frozen=True, eq=False)
class Layout:
    """All parameter sets of a fit, with priors.

    Attributes:
        known: priors about `nominal`, and scales.
        nominal: values before measurement, shape (k,): zero for amplitudes, usual values for shapes such as time constants.
    """

    machine: Machine
    terms: tuple[ParameterSet, ...]
    known: Columns
    nominal: Floats

    @property
    def names(self) -> tuple[tuple[str, str, str], ...]:
        """Return source, sharing set and parameter of every column."""
        return tuple((term.source.name, term.shared, p.name) for term in self.terms for p in term.parameters)

    def columns_of(self, source: str) -> tuple[Integers, Integers]:
        """Return columns of a source's amplitudes and of its shape parameters, over all sets."""
        numbered = [
            (term.columns.start + k, bool(parameter.grid))
            for term in self.terms
            if term.source.name == source
            for k, parameter in enumerate(term.parameters)
        ]
        amplitudes = np.array([number for number, shape in numbered if not shape], dtype=np.int64)
        return amplitudes, np.array([number for number, shape in numbered if shape], dtype=np.int64)

    @property
    def fitted(self) -> Integers:
        """Return the columns of parameters that are not random."""
        return np.flatnonzero(~self.known.random)

    @property
    def parameters(self) -> list[Parameter]:
        """Return the parameter of each column."""
        return [p for term in self.terms for p in term.parameters]

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """Return lower and upper limits of every column, shape (k,) each: shapes may exceed their grid by one step."""
        each = [p.limits for p in self.parameters]
        return np.array([low for low, _ in each]), np.array([high for _, high in each])

    def held_at(self, x: Floats, columns: Integers) -> Layout:
        """Return the layout with some columns held at their values in x, shape (k,)."""
        nominal, prior = self.nominal.copy(), self.known.prior.copy()
        nominal[columns], prior[columns] = x[columns], HELD * self.known.scale[columns]
        return replace(self, nominal=nominal, known=replace(self.known, prior=prior))

    @property
    def bounded(self) -> Flags:
        """Return whether a tolerance bounds each column, shape (k,)."""
        return np.array([p.tolerance is not None for p in self.parameters], dtype=bool)

    @property
    def unbounded(self) -> Columns:
        """Return what is known of the columns without tolerances."""
        return replace(self.known, prior=np.where(self.bounded, np.inf, self.known.prior))

    def formula_variance(self, x: Floats) -> Floats:
        """Return every column's variance due to the inaccuracy of its formula, shape (k,)."""
        share = [
            0.0 if parameter.grid or term.source.name in GEOMETRY else term.source.form_uncertainty
            for term in self.terms
            for parameter in term.parameters
        ]
        return np.where(self.known.random, 0.0, (np.array(share) * x) ** 2)

    @property
    def needs(self) -> frozenset[Need]:
        """Return inputs of all sources that affect the reading."""
        return frozenset[Need]().union(*(term.source.needs for term in self.terms if not term.source.of_currents))

    def model(self, x: Floats) -> MachineModel:
        """Return the machine model at x, shape (k,)."""
        return MachineModel(self.machine, tuple(term.fitted(x) for term in self.terms))


def lay_out(machine: Machine, sources: Sequence[ErrorSource], observations: Sequence[Observation]) -> Layout:
    """Return the layout with all parameter sets that the observations require.

    A source with a stated size is a random effect; size zero removes it. Shape parameters have a prior about a usual
    value. Tolerances of the machine file are priors. Other parameters are not regularised.

    Raises:
        ModelError: machine file or recordings lack an input of a source.
    """
    terms: list[ParameterSet] = []
    prior: list[float] = []
    random: list[bool] = []
    for source, sets in zip(sources, _sets(sources, observations), strict=True):
        parameters = source.parameters(machine)
        for shared, stated in sets.items():
            if isinstance(stated, ModelError):
                raise stated
            if stated is not None and not np.any(stated > 0.0):
                continue
            terms.append(ParameterSet(source, shared, parameters, slice(len(prior), len(prior) + len(parameters))))
            tolerances = [np.inf if p.tolerance is None else p.tolerance for p in parameters]
            sizes = tolerances if stated is None else stated.tolist()
            prior += [p.plausible if p.grid else size for p, size in zip(parameters, sizes, strict=True)]
            random += [stated is not None] * len(parameters)
    every = [p for term in terms for p in term.parameters]
    scale = np.array([p.plausible for p in every])
    nominal = np.array([p.grid[len(p.grid) // 2] if p.grid else 0.0 for p in every])
    return Layout(machine, tuple(terms), Columns(np.array(prior), scale, np.array(random, dtype=bool)), nominal)


_Stated: TypeAlias = "Floats | ModelError | None"
"""Stated standard deviations of a parameter set, shape (p,), None if unstated; or the error that excludes the source."""


def _sets(sources: Sequence[ErrorSource], observations: Sequence[Observation]) -> list[dict[str, _Stated]]:
    found: list[dict[str, _Stated]] = [{} for _ in sources]
    driven = [observation.raw.motor_current_a is not None for observation in observations]
    for motion, has_currents in zip(Motions(observations), driven, strict=True):
        for source, sets in zip(sources, found, strict=True):
            if source.of_currents and any(driven) and not has_currents:
                continue
            stated: _Stated
            try:
                source.require(motion)
                stated = source.stated_mm(motion)
            except ModelError as error:
                stated = error
            sets[source.shared_by(motion)] = stated
    return found
