"""A driver's waiting limits in real and scaled time."""

from __future__ import annotations

from typing import TypedDict

RECONNECT_S = 30.0
"""Time that a measurement waits for an unplugged adapter, so that a person can notice and reconnect it [s]."""

_MEMORY_S = 2.0
"""Time for which the driver remembers the fastest arrival of samples [s]; in a longer time the instrument's clock
drifts."""

_SCALED_MEMORY_S, _SCALED_TIMEOUT_S = 60.0, 5.0
"""Memory of the fastest arrival and patience with a silent line on scaled time [s of real time]. On scaled time a short
pause of the computer is a long time."""


_WAITING_TIMEOUT_S = 600.0
"""Patience with a machine that waits [s]: it is silent while runs are judged. If its program ends, the line closes at
once."""


class DriverPatience(TypedDict):
    """Arguments of `Instrument`."""

    memory_s: float
    timeout_s: float | None


def driver_patience(time_scale: float, *, waits: bool = False) -> DriverPatience:
    """Return arguments of `Instrument` on a clock `time_scale` times as fast as real time."""
    if waits:
        return {"memory_s": _MEMORY_S, "timeout_s": _WAITING_TIMEOUT_S}
    if time_scale == 1.0:
        return {"memory_s": _MEMORY_S, "timeout_s": None}
    return {"memory_s": _SCALED_MEMORY_S * time_scale, "timeout_s": _SCALED_TIMEOUT_S}
