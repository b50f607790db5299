"""Noise of gauges that no model of the program describes: by recipes of its own, none of which draws a spectrum or an autoregression.

Each kind has a standard deviation of about one over a turn, but for 1/f noise, whose standard deviation grows with the time. A
session has `TURNS` turns, one of which is recorded somewhere within it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.plant.arrays import FloatArray

TURNS = 64
"""Turns of a session, over which slow noise has wandered when a circle is recorded."""


def flicker(rng: np.random.Generator, count: int) -> FloatArray:
    """1/f noise as a sum of values, each of which is kept twice as long as the one before it [Voss and McCartney; Gardner 1978]."""
    length = TURNS * count
    total = np.zeros(length)
    octaves = int(np.log2(length))
    for octave in range(octaves):
        held = 2**octave
        values = rng.standard_normal(length // held + 2)
        start = int(rng.integers(held))
        total += np.repeat(values, held)[start : start + length]
    begin = int(rng.integers(length - count))
    # Ten octaves lie within a turn of some hundred samples.
    return total[begin : begin + count] / np.sqrt(np.log2(count))


def telegraph(rng: np.random.Generator, count: int) -> FloatArray:
    """A contact that jumps between two values, thirty times a turn on average, beside white noise of the same power."""
    jumps = rng.random(count) < 30.0 / count
    sign = np.where(np.cumsum(jumps) % 2, 1.0, -1.0) * rng.choice([-1.0, 1.0])
    return np.sqrt(0.5) * (sign + rng.standard_normal(count))


def student(rng: np.random.Generator, count: int) -> FloatArray:
    """Long tails: Student's t of five degrees of freedom, as the ratio that defines it."""
    normal, squares = rng.standard_normal(count), (rng.standard_normal((5, count)) ** 2).mean(axis=0)
    return np.sqrt(0.6) * normal / np.sqrt(squares)


def vibration(rng: np.random.Generator, count: int) -> FloatArray:
    """A vibration that does not fit the turn and whose phase wanders by a tenth of a turn, beside white noise of the same power."""
    cycles, phase = rng.uniform(35.0, 90.0), rng.uniform(0.0, 2.0 * np.pi)
    wander = np.cumsum(rng.standard_normal(count)) * 0.6 / np.sqrt(count)
    wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * cycles * np.arange(count) / count + phase + wander)
    return np.sqrt(0.5) * (wave + rng.standard_normal(count))


def louder_half(rng: np.random.Generator, count: int) -> FloatArray:
    strong = (np.arange(count) + int(rng.integers(count))) % count < count // 2
    return rng.standard_normal(count) * np.where(strong, 1.342, 0.447)


KINDS: dict[str, Callable[[np.random.Generator, int], FloatArray]] = {
    "1/f": flicker,
    "louder in one half": louder_half,
    "Student's t": student,
    "vibration": vibration,
    "jumps": telegraph,
    "coarse gauge": lambda rng, count: rng.standard_normal(count),
}
"""By name. The readings of a coarse gauge come in steps (`STEP`)."""

STEP = {"coarse gauge": 2.0}
"""Step of the readings in standard deviations of the noise, where there is one."""
