"""Thermal growth over a session, the law of all sources that grow with time, or by a logged thermometer.

A body with one time constant tau follows its heat input. In a session this is the heat of work, on average constant
except in pauses:

g(t) = a (1 - exp(-t / tau)) - b p(t),    tau dp/dt = [1 in a pause, else 0] - p,    p(0) = 0

The remaining growth at the session's start is a, negative if the part only cools. The loss in an infinite pause is b:
zero if the drives stay warm, different from a if the part was warm at the start. This is Newton's law of cooling with
intermittent heat. A part heated through another one follows two such bodies (`InTwoStages`).

With a thermometer g(t) = c (T(t) - T_0). T_0 is the reading in the session's first run, so growth is zero at the
session's start, too. T includes sun, open doors and pauses.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from functools import lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.errors import ModelError
from dbbstation.laws.memory import warmed, warmed_by_constant
from dbbstation.sources.contract import EFFECT_SHAPES, Effect, ErrorSource, LinearSource, Motion, Need, Parameter

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


STEEL_UM_M_K = 11.5
"""Thermal expansion of unalloyed steel [µm/(m K)]."""

LOGGED_EQUATION = "or, where T was logged, g = c (T - T at the first sample)"

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

    _of: ClassVar[WarmsUp]

    def __init_subclass__(cls, cause: type[WarmsUp]) -> None:
        super().__init_subclass__(law_of=cause)
        cls._of = cause()

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:  # noqa: ARG002
        return _times(self._of.per_growth(motion, machine), self.warmer_k(motion))

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
        there = known_thermometers(motion)
        return chosen(self.name, self.thermometers, there, "not every run of the session has", remedy)


def chosen(
    source: str, thermometers: Iterable[tuple[str, ...]], there: Collection[str], lacks: str, remedy: str
) -> tuple[str, ...]:
    """Return the best available thermometers of a source.

    Raises:
        ModelError: names missing ones.
    """
    missing = []
    for columns in thermometers:
        missing.append(", ".join(f"{name}_temp_c" for name in dict.fromkeys(columns) if name not in there))
        if not missing[-1]:
            return columns
    what = f"the error source {source} follows a thermometer, and {lacks} {', or '.join(missing)}"
    raise ModelError(what, remedy=remedy)


def following_thermometers(sources: Sequence[ErrorSource], motions: Iterable[Motion]) -> tuple[ErrorSource, ...]:
    """Replace sources by their laws over thermometers, if all runs have these thermometers."""
    forms = ((source, source.by_temperature()) for source in sources)
    return tuple(source if form is None or not_given(form, motions) else form for source, form in forms)


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


TIME_CONSTANTS_S = tuple(float(f"{tau:.3g}") for tau in np.geomspace(300.0, 14400.0, 13))
"""Tried time constants: five minutes to four hours, in ratios of 1.4 [s]."""

PAUSE_S = 600.0
"""Shortest time without a run that counts as a pause [s]. Setting up a ball or changing a bar takes less."""

EQUATION = (
    "a (1 - exp(-t / tau)) - b p(t), t since the session's first sample; p: what pauses of 10 min and more cool; or, in two "
    "stages, less 2 d (exp(-t / tau) - exp(-2 t / tau))"
)
ORIGIN = "linear expansion of a body of one time constant (Newton's law of cooling), heated while the machine works; two bodies, one heated through the other"

FASTER = 0.5
"""Ratio of the second body's time constant to the first's. For a part heated through another with 0.3 to 0.9 of its
constant, ratios of 0.3 to 0.6 err by at most 2.2 % of growth, 0.5 by 1.2 %; one body errs by 7 to 11 %."""


class WarmsUp(ErrorSource):
    """A cause in proportion to a growth g(t) over a session."""

    needs = frozenset({Need.TIME})
    varies_with = "time"
    form_uncertainty = 0.2  # a warm-up has its own law, in stages
    growth: ClassVar[Parameter]
    """Growth from the first sample to the end of the warm-up."""
    usual_s: ClassVar[float]
    """Usual time constant."""

    @abstractmethod
    def per_growth(self, motion: Motion, machine: Machine) -> Effect:
        """Return the effect of a growth of 1 in the unit of the parameters, without an axis of parameters."""

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:  # noqa: ARG002
        reached = "time in which it comes to 63 % of what it will be"
        lost = "what a pause without end would take back; pauses count from ten minutes on"
        pause_loss = f"pause_loss_{self.growth.name.split('_', 1)[1]}"
        return (
            self.growth,
            Parameter("time_constant_s", "s", self.usual_s, reached, TIME_CONSTANTS_S),
            replace(self.growth, name=pause_loss, meaning=lost, newer=True),
        )

    def grown(self, motion: Motion, values: Floats) -> Floats:
        """Return the growth at every sample in the unit of the parameters, shape (n,)."""
        growth, constant_s, loss = values
        law: Floats = growth * warmed(_time_s(motion), constant_s) - loss * _paused(motion, constant_s, warmed)
        return law

    def grown_by(self, motion: Motion, values: Floats) -> Floats:
        """Return derivatives of `grown` by the parameters, shape (n, p)."""
        growth, constant_s, loss = values
        time_s = _time_s(motion)
        by_constant = growth * warmed_by_constant(time_s, constant_s)
        by_constant = by_constant - loss * _paused(motion, constant_s, warmed_by_constant)
        return np.column_stack([warmed(time_s, constant_s), by_constant, -_paused(motion, constant_s, warmed)])

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        self.require(motion)
        return _times(self.per_growth(motion, machine), self.grown(motion, values))

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        self.require(motion)
        return _times(self.per_growth(motion, machine), self.grown_by(motion, values))


def _times(per: Effect, growth: Floats) -> Effect:
    """Return the effect of growths, shape (n,), or of columns of them, (n, p), which become the last axis."""
    found = {}
    for name, axes in EFFECT_SHAPES.items():
        if (each := getattr(per, name)) is not None:
            wide = growth.reshape(len(growth), *(1 for _ in axes), *growth.shape[1:])
            found[name] = wide * (each if growth.ndim == 1 else np.asarray(each)[..., None])
    return Effect(**found)


class InTwoStages(ErrorSource):
    """The sum of two bodies: a cause that warms through another body, or has a fast and a slow part.

    One body has the time constant tau and the growth a + 2 d, the other tau / 2 and -2 d. A part heated through the
    second body starts with zero slope: d = a / 2. With d = 0 there is one body.
    """

    form_uncertainty = 0.1  # heat varies between runs, and more than two bodies warm up
    _one: ClassVar[ErrorSource]

    def __init_subclass__(cls, cause: type[WarmsUp]) -> None:
        super().__init_subclass__(law="two-stages", law_of=cause, extends=cause)
        cls._one = cause()

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        growth, constant, *others = self._one.parameters(machine)
        name = growth.name.split("_", 1)[1]
        meaning = "growth that comes late: half of all where another body is heated first"
        delayed = replace(growth, name=f"delayed_{name}", plausible=FASTER * growth.plausible, meaning=meaning)
        return (growth, replace(constant, grid=TIME_CONSTANTS_S[::2]), *others, delayed)

    def effect(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        slow, fast = (self._one.effect(motion, machine, body @ values) for body in _two_bodies(len(values)))
        return slow + fast

    def derivative(self, motion: Motion, machine: Machine, values: Floats) -> Effect:
        each = (self._one.derivative(motion, machine, body @ values).times(body) for body in _two_bodies(len(values)))
        return sum(each, Effect())


def _two_bodies(count: int) -> tuple[Floats, Floats]:
    """Return matrices from the law's parameters to each body's parameters, shape (count - 1, count)."""
    slow, fast = np.eye(count - 1, count), np.eye(count - 1, count)
    more = 1.0 / (1.0 - FASTER)
    slow[0, -1], slow[2, 2] = more, more
    fast[0, 0], fast[0, -1], fast[1, 1], fast[2, 2] = 0.0, -more, FASTER, -FASTER * more
    return slow, fast


def pauses_s(motion: Motion) -> list[tuple[float, float]]:
    """Return start and end of the session's pauses [s]."""
    return [] if motion.setup is None else _pauses_between(motion.setup.moving_s)


@lru_cache(maxsize=64)
def _pauses_between(moving_s: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
    ends = accumulate((end for _, end in moving_s), max)
    pairs = zip(ends, [begin for begin, _ in moving_s[1:]], strict=False)
    return [(begin, end) for begin, end in pairs if end - begin >= PAUSE_S]


def _paused(motion: Motion, constant_s: float, law: Callable[[Floats, float], Floats]) -> Floats:
    """Return the effect of pauses, shape (n,): warm-up steps down at each start and up at each end."""
    time_s = _time_s(motion)
    steps = [law(time_s - begin, constant_s) - law(time_s - end, constant_s) for begin, end in pauses_s(motion)]
    return sum(steps, np.zeros(len(time_s)))


def _time_s(motion: Motion) -> Floats:
    return np.asarray(motion.time_s)
