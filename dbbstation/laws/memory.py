"""First-order memory: what follows its cause with one time constant."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from dbbstation.computing.compiled import compiled

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.computing.arrays import Floats


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


Number = TypeVar("Number", float, "Floats")


def forgotten(rate: Number, expm1: Callable[[Number], Number]) -> tuple[Number, Number]:
    """Return which share of a lag's error is kept over a step, and which error each change of the input adds.

    It is exact for an input linear in time [triangle-hold equivalent: Franklin, Powell and Workman, Digital Control of
    Dynamic Systems, 3rd ed., sec. 6.3.2].

    Args:
        rate: step over time constant.
        expm1: of such numbers.
    """
    grown = expm1(-rate)
    return 1.0 + grown, grown / rate


def lagging(values: Floats, time: Floats, constant: float) -> Floats:
    """Return values after a first-order lag minus values before it, shape (n,); the initial state is steady.

    Args:
        constant: in `time`'s unit.
    """
    from scipy.linalg import solve_banded  # noqa: PLC0415 - every command knows all sources, which import this file

    kept, added = forgotten(np.diff(time) / constant, np.expm1)
    recursion = np.vstack([np.ones(len(values)), np.append(-kept, 0.0)])
    return solve_banded((1, 0), recursion, np.append(0.0, np.diff(values) * added))


def lagged(speed: Floats, step_s: Floats, constant_s: Floats) -> tuple[Floats, Floats]:
    """Return errors e of loops, with tau de/dt = -e - tau dx/dt, and derivatives by tau, shapes (m, k)."""
    lag, by_constant = np.zeros_like(speed), np.zeros_like(speed)
    _follow(np.ascontiguousarray(speed), np.ascontiguousarray(step_s), constant_s, lag, by_constant)
    return lag, by_constant


FORGOTTEN = 50.0
"""Time constants after which an error has vanished."""


@compiled
def _follow(
    speed: Floats,
    step: Floats,
    constant: Floats,
    lag: Floats,
    by_constant: Floats,
) -> None:
    """Solve each column exactly, with speeds linear between rows."""
    # e = -tau dx/dt + tau² d²x/dt² is a solution; the difference decays as exp(-t / tau).
    rows, columns = speed.shape
    for k in range(rows if rows > 1 else 0):
        last = max(k, 1) - 1
        h = step[last]
        for i in range(columns):
            tau, gain = constant[i], (speed[last + 1, i] - speed[last, i]) / h
            # At first the solution that has forgotten how it began.
            lag[k, i] = -tau * speed[k, i] + tau * tau * gain
            by_constant[k, i] = -speed[k, i] + 2.0 * tau * gain
            if k > 0 and h < FORGOTTEN * tau:
                kept = np.exp(-h / tau)
                beside = lag[last, i] + tau * speed[last, i] - tau * tau * gain
                by_beside = by_constant[last, i] + speed[last, i] - 2.0 * tau * gain
                lag[k, i] += kept * beside
                by_constant[k, i] += kept * (by_beside + beside * h / (tau * tau))
