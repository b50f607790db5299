"""Time shifts: of smooth motions, of sampled signals, of signals at a port, and of a force to first order."""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.laws.contract import Parameter, Scale, ScaledSource, SourceForm, Texts

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from dbbstation.computing.arrays import Floats


MOST_SAMPLES = 5.0
"""Largest shift between filtered channels of one logger, in samples."""


class ForceTimeSkew(ScaledSource):
    """The force is late by d: F(t) = F_true(t - d), to first order F_true - d dF/dt."""

    name = "time-skew"
    varies_with = "rate of force"
    needs = ("force_rate_n_s",)
    form_uncertainty = 0.1  # a filter's delay depends slightly on frequency
    texts = Texts(
        what="The force channel is late or early against the position: filters, bus cycles, the current loop.",
        shows="Peaks where the force changes quickly, at every start, stop and reversal, of one sign where it rises and "
        "of the other where it falls.",
        confirm="Read delay and filter of both channels out of the drive's manual, or shake the drive and look at both "
        "on an oscilloscope.",
        cure="Use channels of one clock, switch filters off, or shift one channel by the delay.",
        equation="F = -d dF/dt",
        origin="Taylor's series to first order; delays in identification: Ljung, System Identification (1999), sec. 14",
    )

    def forms(self, scale: Scale) -> tuple[SourceForm, ...]:
        size = Parameter("delay_ms", "ms", 1e3 * scale.sample_s, "of the force; negative: it is early")
        # The low-pass bounds the noise of the difference.
        return (SourceForm((size,), lambda v, _: -1e-3 * v["force_rate_n_s"][:, None]),)

    def possible(self, values: Mapping[str, float], scale: Scale) -> bool:
        return abs(values.get("delay_ms", 0.0)) <= MOST_SAMPLES * 1e3 * scale.sample_s


def delayed(values: Floats, time: Floats, late: float) -> Floats:
    """Return values delayed by `late` minus values, shape (n,); values are constant before the first row."""
    return np.interp(time - late, time, values) - values


def advanced(values: Floats, time: Floats, early: float) -> tuple[Floats, Floats]:
    """Return smooth values advanced by `early` minus values, and their rates then, shape (n, m); beyond the ends, too."""
    if len(time) == 1:
        return np.zeros_like(values), np.zeros_like(values)
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - takes a third of a second; every command knows all sources

    spline = CubicSpline(time, values)
    return spline(time + early) - spline(time), spline(time + early, 1)


def delaying(late: float) -> Callable[[float, float], float]:
    """Return `delayed` as a function of time and value, which remembers earlier calls and forgets later ones."""
    times: list[float] = []
    past: list[float] = []

    def step(t: float, now: float) -> float:
        while times and times[-1] >= t:
            times.pop()
            past.pop()
        ago = t - late
        then = now if not times or late <= 0.0 else past[0]
        if times and late > 0.0 and ago > times[0]:
            k = bisect_left(times, ago)
            t1, x1 = (t, now) if k == len(times) else (times[k], past[k])
            t0, x0 = times[k - 1], past[k - 1]
            then = x0 + (x1 - x0) * (ago - t0) / (t1 - t0)
        times.append(t)
        past.append(now)
        return then - now

    return step
