"""The contract of a cause of force: what it is given, what it declares, what it answers.

The force that drives a moving mass is linear in amplitudes: mass times acceleration, viscous friction times speed, and
columns of further causes. A cause has one or several forms; a form may hold one number that its columns are not
proportional to (a Stribeck speed, a period), which is searched over.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dbbstation.texts import Texts as Texts  # noqa: PLC0414, TC001 - part of the contract: sources take it from here

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals


@dataclass(frozen=True)
class Parameter:
    """One number of a cause.

    Attributes:
        name: unique within the cause; its unit is its last part.
        unit: as printed.
        plausible: usual size, one standard deviation, in that unit, for the recording at hand.
        meaning: one line with the sign.
    """

    name: str
    unit: str
    plausible: float
    meaning: str


@dataclass(frozen=True, eq=False)
class Form:
    """One form of a cause.

    Attributes:
        amplitudes: what the force is proportional to, p of them.
        columns: force per amplitude at every sample, shape (n, p), for a value of `shape`.
        shape: number that the columns are not proportional to; None where there is none.
        value: of the shape, where the search begins.
        reach: the search may take the value this factor up or down.
    """

    amplitudes: tuple[Parameter, ...]
    columns: Callable[[Signals, float], NDArray[np.float64]]
    shape: Parameter | None = None
    value: float = 0.0
    reach: float = 1.0


class DriveSource(ABC):
    """One physical cause of force. Instances carry no state."""

    name: ClassVar[str]
    varies_with: ClassVar[str]
    """Variable that organises its misfit, as printed."""
    texts: ClassVar[Texts]

    @abstractmethod
    def forms(self, signals: Signals, residual_n: NDArray[np.float64]) -> tuple[Form, ...]:
        """Forms to compare on a recording, none where it cannot show the cause.

        Args:
            signals: the recording.
            residual_n: what is left of the force by everything smooth, at the samples compared, shape (m,) [N]: a first
                look for causes with a period.
        """

    def possible(self, values: Mapping[str, float]) -> bool:  # noqa: ARG002
        """Whether values can be this cause at all, whatever they explain.

        Args:
            values: all parameters of a model that contains the cause, by name.
        """
        return True
