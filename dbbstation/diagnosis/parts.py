"""Forms of a cause: all parts, one part, or a common amplitude; and the variable that it follows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUT_NUMBERS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.calibration.layout import Layout
    from dbbstation.computing.arrays import Flags, Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.machine_model import BarReading
    from dbbstation.sources.contract import ErrorSource, Parameter

ALIKE = "all struts alike"
"""Label of the form that has one amplitude for all struts."""

SESSION_TIME = "the time of the session"
"""Variable of warm-up and drift over a session, in which held-out tests are between others."""


def is_shape(source: ErrorSource, machine: Machine) -> Flags:
    """Return which parameters of a source are nonlinear, shape (p,)."""
    return np.array([bool(p.grid) for p in source.parameters(machine)])


def amplitudes(source: ErrorSource, machine: Machine) -> list[Parameter]:
    """Return the other parameters."""
    return [p for p in source.parameters(machine) if not p.grid]


def at_point(
    source: ErrorSource, machine: Machine, point: Sequence[float] | Floats, sizes: Floats | float = 0.0
) -> Floats:
    """Return a source's values, shape (p,), from nonlinear parameters and amplitudes."""
    shaped = is_shape(source, machine)
    values = np.empty(len(shaped))
    values[shaped], values[~shaped] = point, sizes
    return values


def by_amplitudes(reading: BarReading, source: ErrorSource, machine: Machine, point: Sequence[float]) -> Floats:
    """Return a reading's derivative by a source's amplitudes at nonlinear parameters, shape (n, a)."""
    derivative = reading.by_source(source, machine, at_point(source, machine, point))
    return derivative[:, ~is_shape(source, machine)]


def by_terms(reading: BarReading, layout: Layout, x: Floats) -> Floats:
    """Return a reading's derivative by all parameters of a fit at values of shape (k,): shape (n, k)."""
    found = np.zeros((len(reading.length_mm), len(x)))
    for term in layout.terms:
        if term.acts_on(reading.actual.motion):
            found[:, term.columns] = reading.by_source(term.source, layout.machine, x[term.columns])
    return found


@dataclass(frozen=True)
class Part:
    """One form of a cause.

    Attributes:
        label: strut or part; empty for all.
        amplitudes: indices over all sets; summed if `alike`.
    """

    label: str
    amplitudes: tuple[int, ...]
    log_weight: float

    @property
    def alike(self) -> bool:
        """Return whether all struts share one amplitude."""
        return self.label == ALIKE


def parts_of(amplitudes: Sequence[Parameter], sets: int) -> list[Part]:
    """Return forms with log weights: all amplitudes, one part, two parts that are not struts, or all struts alike.

    Kinds weigh equally, as do a kind's forms.
    """
    every = tuple(range(len(amplitudes) * sets))
    labels = [p.alone_with for p in amplitudes] * sets
    kinds = [[("", every)]]
    if len(set(labels)) > 1:
        alone = [(part, tuple(k for k in every if labels[k] == part)) for part in sorted(set(labels))]
        kinds.append(alone)
        if any(p.part for p in amplitudes):
            # Few orders of a figure are often large; the others would each cost as much as a size of theirs.
            kinds.append(
                [(f"{one} and {two}", tuple(sorted((*a, *b)))) for (one, a), (two, b) in combinations(alone, 2)]
            )
    if sets == 1 and [p.strut for p in amplitudes] == [*STRUT_NUMBERS]:
        kinds.append([(ALIKE, every)])
    return [Part(label, own, -float(np.log(len(kinds) * len(kind)))) for kind in kinds for label, own in kind]


def variable_of(source: ErrorSource) -> str:
    """Return a named cause's variable; its own name without a single variable."""
    return SESSION_TIME if source.varies_with == "time" else source.varies_with or source.name
