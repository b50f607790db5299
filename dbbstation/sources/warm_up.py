"""The warm-up law that sources with their own time constant share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.sources.contract import Parameter

if TYPE_CHECKING:
    from numpy.typing import NDArray

TIME_CONSTANTS_S = tuple(float(f"{tau:.3g}") for tau in np.geomspace(300.0, 14400.0, 13))
"""Time constants worth trying: five minutes to four hours, each 1.4 times the one before [s]."""


def time_constant(usual_s: float, of: str) -> Parameter:
    """Return the parameter of a time constant, to search over."""
    return Parameter(
        "time_constant_s", "s", usual_s, f"time in which {of} comes to 63 % of what it will be", TIME_CONSTANTS_S
    )


def warmed(time_s: NDArray[np.float64], constant_s: float) -> NDArray[np.float64]:
    """Share of a warm-up that has happened, 1 - exp(-t / tau), shape (n,) [1].

    The first-order answer of a body to a constant source of heat (Newton's law of cooling). Before t = 0 nothing has
    happened; a constant of zero (or less, which a fit may try) is its limit, a step at t = 0.

    Args:
        time_s: since the session's first sample, shape (n,) [s].
        constant_s: tau [s].
    """
    since = np.maximum(time_s, 0.0)
    if constant_s <= 0.0:
        return np.where(since > 0.0, 1.0, 0.0)
    return -np.expm1(-since / constant_s)


def warmed_by_constant(time_s: NDArray[np.float64], constant_s: float) -> NDArray[np.float64]:
    """Derivative of `warmed` by the time constant, -t / tau² exp(-t / tau), shape (n,) [1/s]."""
    if constant_s <= 0.0:
        return np.zeros(len(time_s))
    ratio = np.maximum(time_s, 0.0) / constant_s
    return -ratio * np.exp(-ratio) / constant_s


def grown_by(time_s: NDArray[np.float64], amplitude: float, constant_s: float) -> NDArray[np.float64]:
    """Derivatives of a growth a (1 - exp(-t / tau)) by a and by tau, shape (n, 2) [1, unit of a per s]."""
    return np.column_stack([warmed(time_s, constant_s), amplitude * warmed_by_constant(time_s, constant_s)])
