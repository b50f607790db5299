"""The interface of a cause of force."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dbbstation.laws.contract import Parameter as Parameter  # noqa: PLC0414, TC001 - part of the contract
from dbbstation.laws.contract import Texts as Texts  # noqa: PLC0414, TC001 - part of the interface: sources import it from here

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dbbstation.computing.arrays import Floats
    from dbbstation.diagnosis.drive.signals import Signals


@dataclass(frozen=True)
class Scale:
    """Sizes of signals over all recordings, which make amplitudes comparable.

    Attributes:
        mean_m: mean position of compared samples.
        reverses: whether a recording changes direction.
        waves_per_m: strongest residual waves over position [1/m].
    """

    force_n: float
    speed_m_s: float
    low_m: float
    high_m: float
    mean_m: float
    duration_s: float
    cutoff_hz: float
    sample_s: float
    reverses: bool
    both_ways: bool
    waves_per_m: tuple[float, ...] = ()
    waves_tried: float = 1.0

    @property
    def travel_m(self) -> float:
        """Return the distance between the ends of travel [m]."""
        return self.high_m - self.low_m


@dataclass(frozen=True, eq=False)
class DriveForm:
    """One form of a cause.

    Attributes:
        parameters: amplitudes, then nonlinear parameters with an ascending `grid`.
        columns: function from nonlinear parameters to forces per amplitude, shape (n, p).
        label: of a form that can coexist with others; may be empty.
        tried: number of independent forms from which it was picked.
    """

    parameters: tuple[Parameter, ...]
    columns: Callable[[Signals, tuple[float, ...]], Floats]
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


class DriveSource(ABC):
    """One physical cause of force; instances have no state."""

    name: ClassVar[str]
    varies_with: ClassVar[str]
    """Variable on which its force depends, as printed."""
    texts: ClassVar[Texts]
    form_uncertainty: ClassVar[float]
    """Relative standard deviation of real drives from the formula; each source states the reason."""
    prior_probability: ClassVar[float] = 0.05
    """Prior probability that it matters in a drive."""

    @abstractmethod
    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        """Return forms; empty if these recordings cannot show the cause."""

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        """Return whether values are possible for this cause."""
        return True
