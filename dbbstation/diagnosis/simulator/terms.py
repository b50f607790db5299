"""Terms at a port: forms over its signals.

Terms with memory depend only on earlier times, so every integrator receives equal values.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import cos, expm1, pi, sin, sqrt
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import null_space

from dbbstation.laws.memory import forgotten
from dbbstation.laws.play import limited
from dbbstation.laws.time_skew import delaying

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.laws.contract import PortSource

    Evaluate = Callable[[float, Mapping[str, float]], float]


class TermForm(StrEnum):
    """Forms over signals x (and z) with amplitude a."""

    CONSTANT = "constant"  # a
    LINEAR = "linear"  # a x
    SQUARE = "square"  # a x²
    DRAG = "quadratic drag"  # a x |x|
    CUBIC = "cubic"  # a x³
    SIGN = "sign"  # a x / sqrt(x² + rounding²)
    HINGE = "hinge"  # a max(x - place, 0)
    LIMIT = "limited"  # a x within half width, constant beyond
    PRODUCT = "product"  # a x z
    CURVE = "curve"  # a_k B_k(x), splines without a straight line
    MEMORY = "memory"  # a times x through a first-order lag
    SLIP = "stick-slip"  # a times a spring of x that slides beyond a half width, 1 where it slides
    PERIODIC = "periodic"  # a cos x + b sin x, x in turns
    DELAY = "delay"  # delayed x, less x; a is the delay
    LAG = "lag"  # x through a first-order lag, less x; a is its time constant
    PLAY = "play"  # x through a play, less x; a is its half width
    GAP = "dead zone"  # x beyond a half width, zero within, less x; a is the half width
    OWN = "own"  # physics of the user


IN_PLACE = frozenset({TermForm.DELAY, TermForm.LAG, TermForm.PLAY, TermForm.GAP})
"""Forms that replace a signal. Their amplitude is non-negative and no factor."""

MEMORIES = frozenset({TermForm.MEMORY, TermForm.SLIP, TermForm.DELAY, TermForm.LAG, TermForm.PLAY})


@dataclass(frozen=True)
class Term:
    """A term at a port.

    Attributes:
        shape: nonlinear parameters, shape (s,).
        fixed: knots, or period and order.
        bounds: of the shape, shape (s, 2); may be empty.
    """

    port: str
    form: TermForm
    signals: tuple[str, ...]
    amplitudes: tuple[float, ...] = (0.0,)
    shape: tuple[float, ...] = ()
    fixed: tuple[float, ...] = ()
    own: PortSource | None = None
    bounds: tuple[tuple[float, float], ...] = ()

    @property
    def name(self) -> str:
        """Return its name in results."""
        if self.own is not None:
            return f"{self.own.name} at {self.port}"
        of = f" of {' and '.join(self.signals)}" if self.signals else ""
        twice = " twice" if self.form is TermForm.PERIODIC and self.fixed[1] > 1.0 else ""
        return f"{self.form}{twice}{of} at {self.port}"

    @property
    def numbers(self) -> tuple[float, ...]:
        """Return amplitudes, then shape parameters."""
        return (*self.amplitudes, *self.shape)

    def with_numbers(self, numbers: Sequence[float]) -> Term:
        """Return the term with other values, shape (p + s,)."""
        values, count = tuple(float(number) for number in numbers), len(self.amplitudes)
        return replace(self, amplitudes=values[:count], shape=values[count:])


def evaluator(term: Term) -> Evaluate:
    """Return a term's function of time and signals."""
    if term.own is not None:
        return _own(term)
    if term.form in MEMORIES:
        return _remembering(term)
    return _curve(term) if term.form is TermForm.CURVE else _momentary(term)


def _momentary(term: Term) -> Evaluate:
    a = term.amplitudes[0]
    if term.form is TermForm.CONSTANT:
        return lambda _t, _signals: a
    x = term.signals[0]
    if term.form is TermForm.GAP:
        return lambda _t, signals: -min(max(signals[x], -a), a)
    if term.form is TermForm.PRODUCT:
        z = term.signals[1]
        return lambda _t, signals: a * signals[x] * signals[z]
    if term.form is TermForm.PERIODIC:
        b, turns = term.amplitudes[1], 2.0 * pi * term.fixed[1] / term.fixed[0]
        return lambda _t, signals: a * cos(turns * signals[x]) + b * sin(turns * signals[x])
    return _of_one_signal(term.form, x, a, term.shape[0] if term.shape else 0.0)


def _of_one_signal(form: TermForm, x: str, a: float, place: float) -> Evaluate:
    rounding = place * place
    of: dict[TermForm, Evaluate] = {
        TermForm.LINEAR: lambda _t, signals: a * signals[x],
        TermForm.SQUARE: lambda _t, signals: a * ((v := signals[x]) * v),
        TermForm.DRAG: lambda _t, signals: a * ((v := signals[x]) * abs(v)),
        TermForm.CUBIC: lambda _t, signals: a * ((v := signals[x]) * v * v),
        TermForm.SIGN: lambda _t, signals: a * ((v := signals[x]) / sqrt(v * v + rounding)),
        TermForm.HINGE: lambda _t, signals: a * max(signals[x] - place, 0.0),
        TermForm.LIMIT: lambda _t, signals: a * (place if (v := signals[x]) > place else max(v, -place)),
    }
    return of[form]


def _own(term: Term) -> Evaluate:
    own = term.own
    assert own is not None  # noqa: S101 - asked for by the caller
    names = [parameter.name for parameter in own.parameters()]
    values = dict(zip(names, term.numbers, strict=True))
    return lambda t, signals: float(own.value(t, signals, values))


def _curve(term: Term) -> Evaluate:
    knots, x = np.array(term.fixed), term.signals[0]
    # A table is forty times faster than a spline; its error is (step/range)² times the curvature.
    places = np.linspace(knots[0], knots[-1], TABLE)
    values = BSpline(knots, bends(term.fixed) @ np.array(term.amplitudes), DEGREE)(places).tolist()
    low, per = float(knots[0]), (TABLE - 1) / float(knots[-1] - knots[0])

    last = float(TABLE - 1)

    def value(_t: float, signals: Mapping[str, float]) -> float:
        at = (signals[x] - low) * per
        if 0.0 <= at < last:
            k = int(at)
            here: float = values[k]
            return here + (at - k) * (values[k + 1] - here)
        return values[0] if at < 0.0 else values[-1]

    return value


TABLE = 1001
"""Points of a curve's table."""

DEGREE = 3
"""Degree of a curve's splines."""


def bends(knots: Sequence[float]) -> Floats:
    """Return spline coefficients without straight lines, orthonormal, shape (k, k - 2) [Greville abscissae; de Boor, ch. IX]."""
    count = len(knots) - DEGREE - 1
    means = np.array([np.mean(knots[k + 1 : k + 1 + DEGREE]) for k in range(count)])
    return null_space(np.vstack([np.ones(count), means - means.mean()]))


def _remembering(term: Term) -> Evaluate:
    x, a = term.signals[0], term.amplitudes[0]
    if term.form is TermForm.DELAY:
        late = delaying(a)
        return lambda t, signals: late(t, float(signals[x]))
    step, gain, of_signal = _STEPS[term.form](a, term.shape)
    past: list[tuple[float, float, float]] = []  # time, signal and state

    def value(t: float, signals: Mapping[str, float]) -> float:
        while past and past[-1][0] >= t:
            past.pop()
        now = signals[x]
        state = step(past[-1], t, now) if past else 0.0
        past.append((t, now, state))
        return gain * state + of_signal * now

    return value


Step: TypeAlias = "Callable[[tuple[float, float, float], float, float], float]"
"""Function from the previous call's time, signal and state, a time and its signal, to a state."""


def _lagging(constant: float) -> Step:
    """Return a first-order lag, initially settled."""
    if constant <= 0.0:
        return lambda _past, _t, _now: 0.0

    def step(past: tuple[float, float, float], t: float, now: float) -> float:
        kept, added = forgotten((t - past[0]) / constant, expm1)
        return past[2] * kept + (now - past[1]) * added

    return step


def _playing(half: float) -> Step:
    return lambda past, _t, now: limited(past[2] + past[1] - now, half)


_STEPS: Mapping[TermForm, Callable[[float, tuple[float, ...]], tuple[Step, float, float]]] = {
    TermForm.MEMORY: lambda a, shape: (_lagging(shape[0]), a, a),
    TermForm.LAG: lambda a, _: (_lagging(a), 1.0, 0.0),
    TermForm.PLAY: lambda a, _: (_playing(a), 1.0, 0.0),
    TermForm.SLIP: lambda a, shape: (_playing(shape[0]), -a / shape[0], 0.0),
}
"""By form: the function that updates the state, the factor of the state, and the factor of the signal."""
