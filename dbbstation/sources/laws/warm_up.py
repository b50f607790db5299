"""Thermal growth over a session, the law of all sources that grow with time.

A body with one time constant tau follows its heat input. In a session this is the heat of work, on average constant
except in pauses:

g(t) = a (1 - exp(-t / tau)) - b p(t),    tau dp/dt = [1 in a pause, else 0] - p,    p(0) = 0

The remaining growth at the session's start is a, negative if the part only cools. The loss in an infinite pause is b:
zero if the drives stay warm, different from a if the part was warm at the start. This is Newton's law of cooling with
intermittent heat. A part heated through another one follows two such bodies (`InTwoStages`).
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import accumulate
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from dbbstation.sources.contract import Effect, ErrorSource, Parameter

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Motion

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


def warm_up_parameters(growth: Parameter, pause_loss: str, usual_s: float) -> tuple[Parameter, ...]:
    """Return the law's parameters: growth, time constant, pause loss."""
    meaning = "what a pause without end would take back; pauses count from ten minutes on"
    return (
        growth,
        Parameter(
            "time_constant_s", "s", usual_s, "time in which it comes to 63 % of what it will be", TIME_CONSTANTS_S
        ),
        replace(growth, name=pause_loss, meaning=meaning, newer=True),
    )


class InTwoStages(ErrorSource):
    """The sum of two bodies: a cause that warms through another body, or has a fast and a slow part.

    One body has the time constant tau and the growth a + 2 d, the other tau / 2 and -2 d. A part heated through the
    second body starts with zero slope: d = a / 2. With d = 0 there is one body.
    """

    form_uncertainty = 0.1  # heat varies between runs, and more than two bodies warm up
    _one: ClassVar[ErrorSource]

    def __init_subclass__(cls, cause: type[ErrorSource]) -> None:
        super().__init_subclass__()
        cls.name, cls.belongs_to, cls.texts = cause.name, cause.belongs_to, cause.texts
        cls.needs, cls.varies_with, cls.detail_mm = cause.needs, cause.varies_with, cause.detail_mm
        cls._one = cause()

    @property
    def law(self) -> str:
        return "two-stages"

    @property
    def simpler_law(self) -> str:
        return self._one.law

    def parameters(self, machine: Machine) -> tuple[Parameter, ...]:
        growth, constant, *others = self._one.parameters(machine)
        name, meaning = (
            growth.name.split("_", 1)[1],
            "growth that comes late: half of all where another body is heated first",
        )
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


def grown(motion: Motion, values: Floats) -> Floats:
    """Return the growth at every sample in the unit of the parameters, shape (n,)."""
    growth, constant_s, loss = values
    law: Floats = growth * warmed(_time_s(motion), constant_s) - loss * _paused(motion, constant_s, warmed)
    return law


def grown_by(motion: Motion, values: Floats) -> Floats:
    """Return derivatives of `grown` by its parameters, shape (n, 3)."""
    growth, constant_s, loss = values
    time_s = _time_s(motion)
    by_constant = growth * warmed_by_constant(time_s, constant_s)
    by_constant = by_constant - loss * _paused(motion, constant_s, warmed_by_constant)
    return np.column_stack([warmed(time_s, constant_s), by_constant, -_paused(motion, constant_s, warmed)])


def warmed(time_s: Floats, constant_s: float) -> Floats:
    """Return the completed share of a warm-up, 1 - exp(-t / tau), shape (n,) [1].

    It is zero before t = 0; a time constant of zero or less gives a step.
    """
    since = np.maximum(time_s, 0.0)
    if constant_s <= 0.0:
        return np.where(since > 0.0, 1.0, 0.0)
    return -np.expm1(-since / constant_s)


def warmed_by_constant(time_s: Floats, constant_s: float) -> Floats:
    """Return the derivative of `warmed` by the constant, -t / tau² exp(-t / tau), shape (n,) [1/s]."""
    if constant_s <= 0.0:
        return np.zeros(len(time_s))
    ratio = np.maximum(time_s, 0.0) / constant_s
    return -ratio * np.exp(-ratio) / constant_s


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
