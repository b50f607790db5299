"""A driver's patience in real and scaled time."""

from __future__ import annotations

from typing import TypedDict

RECONNECT_S = 30.0
"""How long a measurement waits for an adapter whose cable was pulled out: time to see it and to put it back [s]."""

_MEMORY_S = 2.0
"""How long the driver remembers the quickest arrival of samples; longer, the instrument's clock would drift [s]."""

_SCALED_MEMORY_S, _SCALED_TIMEOUT_S = 60.0, 5.0
"""On scaled time a moment in which the computer attends to something else is long: the driver then remembers the quickest
arrival of samples for this long, and waits this long for a line that is silent [s of real time]."""


_WAITING_TIMEOUT_S = 600.0
"""A machine that waits is silent while runs are judged; where its program ends, the line is closed and nobody waits [s]."""


class DriverPatience(TypedDict):
    """Arguments of `Instrument`."""

    memory_s: float
    timeout_s: float | None


def driver_patience(time_scale: float, *, waits: bool = False) -> DriverPatience:
    """Return arguments of `Instrument` on a clock `time_scale` times faster than real."""
    if waits:
        return {"memory_s": _MEMORY_S, "timeout_s": _WAITING_TIMEOUT_S}
    if time_scale == 1.0:
        return {"memory_s": _MEMORY_S, "timeout_s": None}
    return {"memory_s": _SCALED_MEMORY_S * time_scale, "timeout_s": _SCALED_TIMEOUT_S}
