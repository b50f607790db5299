"""The contract of a cause of force: what it is given, what it declares, what it answers.

The force that drives a moving mass is linear in amplitudes: mass times acceleration, viscous friction times speed, and
columns of further causes. A cause has one or several forms; a form may hold numbers that its columns are not proportional
to (a Stribeck speed, a period), which begin on a grid and are then improved.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from dbbstation.text.texts import Texts as Texts  # noqa: PLC0414, TC001 - part of the contract: sources take it from here

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals


@dataclass(frozen=True)
class Scale:
    """Sizes of all recordings together: they make amplitudes comparable.

    Attributes:
        force_n: root mean square of the force in the band [N].
        speed_m_s: greatest speed [m/s].
        mean_m: mean position at the samples compared [m].
        cutoff_hz: of the band in which force and model are compared.
        reverses: some recording changes its direction of travel.
        both_ways: enough samples are travelled in each direction to say how these differ.
        waves_per_m: waves over the position that the residual of everything smooth follows best, strongest first [1/m].
        waves_tried: how many independent waves these were picked from.
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
        """Between the ends of the travel [m]."""
        return self.high_m - self.low_m


@dataclass(frozen=True)
class DriveParameter:
    """One number of a cause.

    Attributes:
        name: unique within the cause; its unit is its last part.
        plausible: usual size, one standard deviation, in that unit, for the recording at hand.
        meaning: one line with the sign.
        positive: it cannot be negative.
    """

    name: str
    unit: str
    plausible: float
    meaning: str
    positive: bool = False


@dataclass(frozen=True, eq=False)
class DriveForm:
    """One form of a cause.

    Attributes:
        amplitudes: what the force is proportional to, p of them.
        columns: force per amplitude at every sample of a recording, shape (n, p), for values of `shapes`.
        shapes: numbers that the columns are not proportional to.
        grids: values of each of these to begin with, rising.
        label: what tells it from other forms of the cause, which may be there beside it; empty where there is one only.
        tried: independent forms that it was picked from by looking at the recording.
    """

    amplitudes: tuple[DriveParameter, ...]
    columns: Callable[[Signals, tuple[float, ...]], NDArray[np.float64]]
    shapes: tuple[DriveParameter, ...] = ()
    grids: tuple[tuple[float, ...], ...] = ()
    label: str = ""
    tried: float = 1.0


class DriveSource(ABC):
    """One physical cause of force. Instances carry no state."""

    name: ClassVar[str]
    varies_with: ClassVar[str]
    """Variable that organises its misfit, as printed."""
    texts: ClassVar[Texts]
    form_uncertainty: ClassVar[float]
    """Share of the effect by which real drives depart from the formula, one standard deviation; its reason stands beside it."""
    prior_probability: ClassVar[float] = 0.05
    """That a drive has it so that it matters, before anything is measured."""

    @abstractmethod
    def forms(self, scale: Scale) -> tuple[DriveForm, ...]:
        """Forms to compare, none where the recordings cannot show the cause."""

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:  # noqa: ARG002
        """Whether values can be this cause at all, whatever they explain.

        Args:
            values: all parameters of a model that contains the cause, by name.
            scale: sizes of the recordings.
        """
        return True
