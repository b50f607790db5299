"""Growth by a logged thermometer instead of a law of time.

g(t) = c (T(t) - T_0)

T_0 is the reading in the session's first run, so growth is zero at the session's start, as in `warm_up`. T includes
sun, open doors and pauses.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.sources.contract import Effect, ErrorSource, LinearSource, Motion, Need, Parameter

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine

STEEL_UM_M_K = 11.5
"""Thermal expansion of unalloyed steel [µm/(m K)]."""

EQUATION = "or, where T was logged, g = c (T - T at the first sample)"

FOLLOWED_K = 0.2
"""Least range of a usable temperature over a session [K]; thermometers resolve a tenth."""

MACHINE = ("machine",)
"""A thermometer on the base plate or the machine as a whole."""


class FollowsTemperature(LinearSource):
    """A cause's law by thermometers instead of time, with the cause's name and texts."""

    needs = frozenset({Need.POSE, Need.TIME, Need.TEMPERATURE})
    varies_with = "temperature"
    form_uncertainty = 0.1  # a thermometer measures one place of a body
    growth: ClassVar[Parameter]
    """Growth per kelvin."""
    thermometers: ClassVar[tuple[tuple[str, ...], ...]]
    """Columns without unit, best choice first: one for the whole part, or one per strut."""

    def __init_subclass__(cls, cause: type[ErrorSource]) -> None:
        super().__init_subclass__()
        cls.name, cls.belongs_to, cls.texts = cause.name, cause.belongs_to, cause.texts
        cls.detail_mm = cause.detail_mm

    @abstractmethod
    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        """Return the derivative by the growth per kelvin, from `warmer_k`."""

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        return (self.growth,)

    def require(self, motion: Motion) -> None:
        """Refuse a motion without suitable thermometers.

        Raises:
            ModelError: names the source and suitable columns.
        """
        super().require(motion)
        self._columns(motion)

    @property
    def has_history(self) -> bool:
        return True

    def begin(self, motion: Motion, machine: Machine, values: Floats) -> Motion:  # noqa: ARG002
        return motion.stretch(slice(0, 1))

    def advance(self, motion: Motion, machine: Machine, values: Floats, state: Motion) -> tuple[Effect, Motion]:
        return self.effect(motion.after(state), machine, values).last(len(motion)), state

    def warmer_k(self, motion: Motion) -> Floats:
        """Return the warming since the session's start [K], shape (n, 1), or (n, 6) for struts."""
        self.require(motion)
        logged = [logged_degc(motion, name) for name in self._columns(motion)]
        return np.column_stack([degc - first for degc, first in logged])

    def moves(self, motion: Motion) -> bool:
        """Return whether its thermometers changed by at least `FOLLOWED_K`."""
        shown = [motion.setup.thermometers[name].degc for name in self._columns(motion)] if motion.setup else []
        return any(np.ptp(degc) > FOLLOWED_K for degc in shown)

    def _columns(self, motion: Motion) -> tuple[str, ...]:
        remedy = "give recordings with that column, or a model without this source"
        return self.chosen(known_thermometers(motion), "not every run of the session has", remedy)

    def chosen(
        self,
        logged: Collection[str],
        lacks: str = "the control has no",
        remedy: str = "name the thermometers of the control with --thermometers, or leave the source out with --leave-out",
    ) -> tuple[str, ...]:
        """Return the best available thermometers.

        Raises:
            ModelError: names missing ones.
        """
        for columns in self.thermometers:
            if all(name in logged for name in columns):
                return columns
        missing = [[f"{name}_temp_c" for name in columns if name not in logged] for columns in self.thermometers]
        raise ModelError(
            f"the error source {self.name} follows a thermometer, and {lacks} "
            + ", or ".join(", ".join(names) for names in missing),
            remedy=remedy,
        )


def following_thermometers(sources: Sequence[ErrorSource], motions: Iterable[Motion]) -> tuple[ErrorSource, ...]:
    """Replace sources by their laws over thermometers, if all runs have these thermometers."""
    return tuple(_logged(source, motions) or source for source in sources)


def _logged(source: ErrorSource, motions: Iterable[Motion]) -> ErrorSource | None:
    form = source.by_temperature()
    if form is None or not_given(form, motions):
        return None
    return form


def not_given(source: ErrorSource, motions: Iterable[Motion]) -> str:
    """Return which of a source's inputs motions lack, or that its temperatures hardly change; empty if neither."""
    try:
        for motion in motions:
            source.require(motion)
    except ModelError as error:
        return error.what
    if isinstance(source, FollowsTemperature) and not any(source.moves(motion) for motion in motions):
        return f"the thermometers of {source.name} moved by less than {FOLLOWED_K:g} K"
    return ""


def known_thermometers(motion: Motion) -> set[str]:
    """Return names of thermometers with known temperatures."""
    if motion.setup is not None and motion.setup.thermometers:
        return set(motion.setup.thermometers)
    return set(motion.temperature_degc)


def logged_degc(motion: Motion, name: str) -> tuple[Floats, float]:
    """Return a thermometer's temperatures, shape (n,), and its value at the session's start [degC]."""
    if motion.setup is None or not motion.setup.thermometers or motion.time_s is None:
        own = motion.temperature_degc[name]
        return own, float(own[0])
    over = motion.setup.thermometers[name]
    return np.interp(motion.time_s, over.time_s, over.degc), float(over.degc[0])
