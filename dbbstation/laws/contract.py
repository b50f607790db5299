"""The interface of a law: parameters, and its effect over columns or at a port."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.computing.arrays import Floats


@dataclass(frozen=True)
class Texts:
    """Texts of a cause."""

    what: str
    shows: str
    confirm: str
    cure: str
    equation: str
    origin: str


BEYOND_PLAUSIBLE = 100.0
"""Largest value in usual sizes: 20 mm on a strut's reference length, 5 mm on a joint, 0.3 mm of play. A kinematic fit
without gravity shifts joints up to 0.27 mm, with a usual size of 0.05 mm, so ten would be too few. Usual values with a
misplaced decimal point, or in micrometres for millimetres, mostly exceed the limit."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a source.

    Attributes:
        name: unique in the source, ending with its unit.
        plausible: usual size, one standard deviation, in the unit.
        grid: search values of a nonlinear parameter (time constant, phase); empty for an amplitude.
        tolerance: the machine file's standard deviation, used as prior; or None.
        newer: True if older models lack it; there it is zero.
        positive: cannot be negative; a significant negative fit indicates another cause.
        listed: only values of `grid` are possible.
        part: label of amplitudes that may be wrong alone; empty for struts and for sources without parts.
        strut: 1 to 6; one strut's amplitudes may be wrong alone. None if of no strut.
    """

    name: str
    unit: str
    plausible: float
    meaning: str
    grid: tuple[float, ...] = ()
    tolerance: float | None = None
    newer: bool = False
    positive: bool = False
    listed: bool = False
    part: str = ""
    strut: int | None = None

    @property
    def alone_with(self) -> str:
        """Return the label of the part that may be wrong alone."""
        return self.part or (f"strut {self.strut}" if self.strut else "")

    @property
    def largest(self) -> float:
        """Return the largest value allowed in a model, in the parameter's unit."""
        return max(BEYOND_PLAUSIBLE * self.plausible, *(10.0 * abs(value) for value in self.grid), 0.0)

    @property
    def limits(self) -> tuple[float, float]:
        """Return a nonlinear parameter's limits in a fit; infinite for amplitudes and listed values.

        Positive parameters may exceed their grid by the ratio of its outer steps, others by the grid's length.
        """
        grid = sorted(self.grid)
        if len(grid) < 2 or self.listed:  # noqa: PLR2004 - a step needs two values
            return -math.inf, math.inf
        if grid[0] > 0.0:
            return grid[0] ** 2 / grid[1], grid[-1] ** 2 / grid[-2]
        return 2.0 * grid[0] - grid[-1], 2.0 * grid[-1] - grid[0]


class PortSource(ABC):
    """A physical cause at a port of a simulator; instances have no state."""

    name: ClassVar[str]
    """Unique, in small letters with hyphens."""

    port: str = ""
    """Port of `model.yaml` at which it acts; empty: the only one."""

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """Return amplitudes, then nonlinear parameters with a `grid`."""

    @abstractmethod
    def value(self, t: float, signals: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        """Return the value at the port, in its unit."""


class TableSource(PortSource):
    """A physical cause over columns: of a table's difference, a drive's force, a strut's length, or at a port.

    A drive and a strut have the columns of `MOVING`; a port has its signals and `t_s`.
    """

    needs: ClassVar[tuple[str, ...]]
    """Required columns; if one is missing, the source is omitted."""

    texts: ClassVar[Texts]

    form_uncertainty: ClassVar[float] = 0.02
    """Relative standard deviation of real objects from the formula: 0.02 for springs and geometry, 0.1 to 0.3 for
    friction, play and warm-up."""

    follows: ClassVar[str] = ""
    """Column over which they depart from the formula; if empty, the first in `needs`."""

    @abstractmethod
    def columns(self, variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
        """Return the effect of unit amplitudes, shape (n, p): in the measured unit, in N of a drive, in µm of a strut."""

    def value(self, t: float, signals: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        """Return the value at the port, the effect over one row."""
        row = {name: np.array([t if name == "t_s" else signals[name]]) for name in self.needs}
        sizes = [parameters[p.name] for p in self.parameters() if not p.grid]
        shapes = {p.name: parameters[p.name] for p in self.parameters() if p.grid}
        return float(self.columns(row, shapes)[0] @ sizes)


MOVING = {
    "t_s": "time",
    "position_mm": "position",
    "speed_mm_s": "speed",
    "acceleration_mm_s2": "acceleration",
    "direction": "speed",
    "since_reversal_mm": "travel since reversal",
}
"""Columns of a moving drive or strut, with their variables. `direction` is +1, -1, or 0 at standstill of a drive;
`since_reversal_mm` is infinite before the first reversal. A strut's position is its length."""
