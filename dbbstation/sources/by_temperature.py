"""How a part grows with what a thermometer on it logged: what sources that grow with time do where one was there.

    g(t) = c (T(t) - T_0)

T_0 is what it showed at the session's first sample, so that growth is counted as in `warm_up`. No law of time is needed:
sun, an open door and pauses are in T.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.sources.contract import Effect, ErrorSource, LinearSource, Motion, Need, Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from dbbstation.machine.geometry import Machine

STEEL_UM_M_K = 11.5
"""Thermal expansion of unalloyed steel, [µm/(m K)]."""

EQUATION = "or, where T was logged, g = c (T - T at the first sample)"

MACHINE = ("machine",)
"""A thermometer on the base plate or the machine as a whole."""


class FollowsTemperature(LinearSource):
    """A cause that grows with time, in the form that follows thermometers. It has the name and the texts of the cause."""

    needs = frozenset({Need.POSE, Need.TEMPERATURE})
    varies_with = "temperature"
    growth: ClassVar[Parameter]
    """What it grows by for one kelvin."""
    thermometers: ClassVar[tuple[tuple[str, ...], ...]]
    """Columns without their unit, the best choice first: one for all of the part, or one for each strut."""

    def __init_subclass__(cls, cause: type[ErrorSource]) -> None:
        """Take name, owner and texts from the cause."""
        super().__init_subclass__()
        cls.name, cls.belongs_to, cls.texts = cause.name, cause.belongs_to, cause.texts

    @abstractmethod
    def derivative(self, motion: Motion, machine: Machine, values: NDArray[np.float64]) -> Effect:
        """By the growth per kelvin, from `warmer_k`."""

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        """Growth per kelvin."""
        return (self.growth,)

    def require(self, motion: Motion) -> None:
        """Refuse a motion without its thermometers.

        Raises:
            ModelError: names the source and the columns that would do.
        """
        super().require(motion)
        self._columns(motion)

    def warmer_k(self, motion: Motion) -> NDArray[np.float64]:
        """How much warmer than at the session's first sample, shape (n, 1) or, of struts, (n, 6) [K]."""
        self.require(motion)
        columns = [slow_degc(motion, name) for name in self._columns(motion)]
        return np.column_stack([degc - first for degc, first in columns])

    def _columns(self, motion: Motion) -> tuple[str, ...]:
        for columns in self.thermometers:
            if all(name in motion.temperature_degc for name in columns):
                return columns
        wanted = " or ".join(f"{columns[0]}_temp_c" for columns in self.thermometers)
        raise ModelError(
            f"the error source {self.name} follows a thermometer, and {wanted} was not logged here",
            remedy="give recordings with that column, or a model without this source",
        )


def following_thermometers(sources: Sequence[ErrorSource], motions: Sequence[Motion]) -> tuple[ErrorSource, ...]:
    """Sources, those that grow with time in the form that follows thermometers where all runs have what that needs."""
    return tuple(_logged(source, motions) or source for source in sources)


def _logged(source: ErrorSource, motions: Sequence[Motion]) -> ErrorSource | None:
    form = source.by_temperature()
    if form is None:
        return None
    try:
        for motion in motions:
            form.require(motion)
    except ModelError:
        return None
    return form


def slow_degc(motion: Motion, name: str) -> tuple[NDArray[np.float64], float]:
    """What a thermometer showed, shape (n,), and what it showed at the session's first sample [degC].

    As the session's curve where there is one: parts of a machine change slowly, and thermometers are coarse.
    """
    own = motion.temperature_degc[name]
    over = None if motion.setup is None or motion.time_s is None else motion.setup.thermometers.get(name)
    if over is None or motion.time_s is None:
        return own, float(own[0])
    return np.interp(motion.time_s, over.time_s, over.degc), float(over.degc[0])
