"""The interface of a law: parameters, and its effect over columns or at a port."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

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


@dataclass(frozen=True)
class Scale:
    """Sizes of signals over all recordings of a drive, which make amplitudes comparable; initially of a usual drive.

    Attributes:
        mean_m: mean position of compared samples.
        reverses: whether a recording changes direction.
        waves_per_m: strongest residual waves over position [1/m].
    """

    force_n: float = 100.0
    speed_m_s: float = 0.1
    low_m: float = 0.0
    high_m: float = 0.2
    mean_m: float = 0.1
    duration_s: float = 60.0
    cutoff_hz: float = 20.0
    sample_s: float = 1e-3
    reverses: bool = True
    both_ways: bool = True
    waves_per_m: tuple[float, ...] = (100.0,)
    waves_tried: float = 1.0

    @property
    def travel_m(self) -> float:
        """Return the distance between the ends of travel [m]."""
        return self.high_m - self.low_m


@dataclass(frozen=True, eq=False)
class SourceForm:
    """One form of a cause.

    Attributes:
        parameters: amplitudes, then nonlinear parameters with an ascending `grid`.
        columns: as `TableSource.columns`.
        label: of a form that can coexist with others; may be empty.
        tried: number of independent forms from which it was picked.
    """

    parameters: tuple[Parameter, ...]
    columns: Callable[[Mapping[str, Floats], Mapping[str, float]], Floats]
    label: str = ""
    tried: float = 1.0

    @property
    def amplitudes(self) -> tuple[Parameter, ...]:
        """Return the amplitudes."""
        return tuple(p for p in self.parameters if not p.grid)

    @property
    def shapes(self) -> tuple[Parameter, ...]:
        """Return the nonlinear parameters."""
        return tuple(p for p in self.parameters if p.grid)

    def at(self, variables: Mapping[str, Floats], point: Iterable[float]) -> Floats:
        """Return the effect of unit amplitudes at nonlinear parameters, shape (n, p)."""
        named = zip((p.name for p in self.shapes), point, strict=True)
        return np.asarray(self.columns(variables, dict(named)), dtype=np.float64)


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

    prior_probability: ClassVar[float] = 0.05
    """Prior probability that it matters in a drive."""

    varies_with: ClassVar[str] = ""
    """Variable of a drive on which its force depends, as printed; if empty, that of `follows`."""

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:  # noqa: ARG002
        """Return forms in a drive; empty if recordings of this scale cannot show the cause."""
        return (SourceForm(self.parameters(), self.columns),)

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        """Return whether values are possible in a drive."""
        return True

    @abstractmethod
    def columns(self, variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
        """Return the effect of unit amplitudes, shape (n, p): in the measured unit, in N of a drive, in µm of a strut."""

    def value(self, t: float, signals: Mapping[str, float], parameters: Mapping[str, float]) -> float:
        """Return the value at the port, the effect over one row."""
        row = {name: np.array([t if name == "t_s" else signals[name]]) for name in self.needs}
        form = SourceForm(self.parameters(), self.columns)
        sizes = [parameters[p.name] for p in form.amplitudes]
        return float(form.at(row, [parameters[p.name] for p in form.shapes])[0] @ sizes)


class ScaledSource(TableSource):
    """A law whose sizes follow from a drive's recordings; elsewhere they are those of a usual drive.

    Only its first form acts elsewhere; a law without a form acts in drives only.
    """

    @abstractmethod
    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        """Return forms; empty if recordings of this scale cannot show the cause."""

    def parameters(self) -> tuple[Parameter, ...]:
        return self.forms(Scale())[0].parameters

    def columns(self, variables: Mapping[str, Floats], shapes: Mapping[str, float]) -> Floats:
        return self.forms(Scale())[0].columns(variables, shapes)


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
