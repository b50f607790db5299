"""First-order memory: what follows its cause with one time constant, such as warming parts, filters and position loops.

A position loop goes along a program row by row. The program is straight between rows and bends at rows. On a smooth path
the parabola through a row and the two rows before gives the speed at this row. At a bend or change of feed the last
straight segment gives the speed:

v = s + w (s - s') h / (h + h'),    w = max(0, s . s') / max(s . s, s' . s')

s and s' are the mean speeds of all struts over the last two steps h and h'. On a smooth path w is 1 to first order, so
v is exact to second order; after a stop or a corner of 90 degrees w is 0. Backward differences solve the loop y + tau
v(y) = x with this speed of the output [Gear, Numerical Initial Value Problems in Ordinary Differential Equations, 1971,
ch. 11]. The command for a wanted output thus follows from the output's speed, without oscillation between rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from dbbstation.computing.compiled import compiled, inlined

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


SHORTEST_S = 1e-6
"""Rows closer in time than this are one row, because their difference is rounding [s]."""

INPUT, INPUT_SPEED, OUTPUT, OUTPUT_SPEED = range(4)
BY_CONSTANT, SPEED_BY_CONSTANT = (4, 5), (6, 7)


@dataclass(frozen=True, eq=False)
class LoopState:
    """Memory of m loops.

    Attributes:
        rows: number of rows so far: 0 at the start, 2 once a speed is known.
        memory: commanded and driven length [mm], mean speeds of the last step [mm/s], and derivatives of driven length
            and speed by both time constants, shape (8, m).
    """

    rows: int
    time_s: float
    step_s: float
    memory: Floats


def driven(length_mm: Floats, time_s: Floats, constant_s: Floats, state: LoopState) -> tuple[Floats, Floats, LoopState]:
    """Return errors y - x [mm], shape (n, m), derivatives by tau [mm/s], shape (n, 2, m), and the last state.

    Args:
        time_s: shape (n,); rows within `SHORTEST_S` are one.
        constant_s: tau while y decreases and while it increases, shape (2, m); a negative tau leads by -tau dx/dt.
    """
    lag, memory = np.empty_like(length_mm), state.memory.copy()
    by_constant = np.empty((len(length_mm), 2, length_mm.shape[1]))
    clock = np.array([state.rows, state.time_s, state.step_s])
    lengths, times = np.ascontiguousarray(length_mm), np.ascontiguousarray(time_s)
    _drive(lengths, times, constant_s, SHORTEST_S, clock, memory, lag, by_constant)
    return lag, by_constant, LoopState(int(clock[0]), float(clock[1]), float(clock[2]), memory)


def undone(
    length_mm: Floats,
    reached_mm: Floats,
    time_s: Floats,
    constant_s: Floats,
    state: LoopState,
) -> Floats:
    """Return errors y - x of loops that reach given y, shape (n, m) [mm].

    Args:
        length_mm: commands near the solution, which determine bends, shape (n, m).
    """
    error = np.empty_like(length_mm)
    clock = np.array([state.rows, state.time_s, state.step_s])
    length, reached, time = (np.ascontiguousarray(array) for array in (length_mm, reached_mm, time_s))
    _undo(length, reached, time, constant_s, SHORTEST_S, clock, state.memory.copy(), error)
    return error


@inlined
def _even(length: Floats, memory: Floats, h: float, clock: Floats) -> float:
    """Return the factor of the speed change, w h / (h + h')."""
    both = new = old = 0.0
    for i in range(len(length)):
        speed = (length[i] - memory[INPUT, i]) / h
        both += speed * memory[INPUT_SPEED, i]
        new += speed * speed
        old += memory[INPUT_SPEED, i] * memory[INPUT_SPEED, i]
    return both / max(new, old) * h / (h + clock[2]) if clock[0] > 1.0 and both > 0.0 else 0.0


@compiled
def _undo(
    length: Floats,
    reached: Floats,
    time: Floats,
    constant: Floats,
    shortest: float,
    clock: Floats,
    memory: Floats,
    error: Floats,
) -> None:
    count, columns = length.shape
    needed, needed_speed = memory[INPUT].copy(), memory[INPUT_SPEED].copy()
    for k in range(count):
        h = time[k] - clock[1]
        if clock[0] == 0.0 or h <= shortest:
            for i in range(columns):
                error[k, i] = memory[OUTPUT, i] - needed[i]
                memory[INPUT, i], memory[OUTPUT, i] = length[k, i], reached[k, i]
                needed[i] = reached[k, i] - error[k, i]
            if clock[0] == 0.0:
                clock[0], clock[1] = 1.0, time[k]
            continue
        share = _even(length[k], memory, h, clock)
        gain = (1.0 + share) / h
        for i in range(columns):
            y = reached[k, i]
            speed = gain * (y - memory[OUTPUT, i]) - share * memory[OUTPUT_SPEED, i]
            x = y + constant[int(speed > 0.0), i] * speed
            if constant[int(speed > 0.0), i] < 0.0:
                before = gain * needed[i] + share * needed_speed[i]
                tau = min(constant[int(gain * y > before), i], 0.0)
                x = (y - tau * before) / (1.0 - tau * gain)
            error[k, i] = y - x
            memory[OUTPUT_SPEED, i], memory[OUTPUT, i] = (y - memory[OUTPUT, i]) / h, y
            needed_speed[i], needed[i] = (x - needed[i]) / h, x
            memory[INPUT_SPEED, i], memory[INPUT, i] = (length[k, i] - memory[INPUT, i]) / h, length[k, i]
        clock[0], clock[1], clock[2] = 2.0, time[k], h


@compiled
def _drive(
    length: Floats,
    time: Floats,
    constant: Floats,
    shortest: float,
    clock: Floats,
    memory: Floats,
    lag: Floats,
    by_constant: Floats,
) -> None:
    count, columns = length.shape
    for k in range(count):
        h = time[k] - clock[1]
        if clock[0] == 0.0 or h <= shortest:
            for i in range(columns):
                error = memory[OUTPUT, i] - memory[INPUT, i]
                memory[INPUT, i], memory[OUTPUT, i] = length[k, i], length[k, i] + error
                lag[k, i] = error
                for way in range(2):
                    by_constant[k, way, i] = memory[BY_CONSTANT[way], i]
            if clock[0] == 0.0:
                clock[0], clock[1] = 1.0, time[k]
            continue
        share = _even(length[k], memory, h, clock)
        for i in range(columns):
            x, at, gain = length[k, i], memory[OUTPUT, i], (1.0 + share) / h
            speed, before = (x - memory[INPUT, i]) / h, gain * at + share * memory[OUTPUT_SPEED, i]
            now = int(gain * x > before)
            tau, leads = max(constant[now, i], 0.0), constant[now, i] < 0.0
            y = (x + tau * before) / (1.0 + tau * gain)
            by_y, kept = (before - gain * y) / (1.0 + tau * gain), tau / (1.0 + tau * gain)
            if leads:
                by_y, kept = share * memory[INPUT_SPEED, i] - (1.0 + share) * speed, 0.0
                now = int(by_y < 0.0)
                y = x + min(constant[now, i], 0.0) * by_y
            for way in range(2):
                by_at = memory[BY_CONSTANT[way], i]
                by = kept * (gain * by_at + share * memory[SPEED_BY_CONSTANT[way], i]) + (by_y if way == now else 0.0)
                memory[BY_CONSTANT[way], i], memory[SPEED_BY_CONSTANT[way], i] = by, (by - by_at) / h
                by_constant[k, way, i] = by
            memory[INPUT, i], memory[INPUT_SPEED, i] = x, speed
            memory[OUTPUT, i], memory[OUTPUT_SPEED, i] = y, (y - at) / h
            lag[k, i] = y - x
        clock[0], clock[1], clock[2] = 2.0, time[k], h
