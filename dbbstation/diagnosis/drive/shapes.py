"""Forces without a name: any smooth force that some variable organises.

They compete with the named causes. Where one of them explains the recording clearly better than all causes that have a
name, the cause is unknown, and the variable is what can be said of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from dbbstation.diagnosis.drive.signals import Signals

HATS = 11
"""Points of a piecewise linear curve."""

PLAUSIBLE_SHARE = 0.3
"""Usual size of an unnamed force, one standard deviation, of the force's root mean square."""

NEAREST_SHARE = 1e-4
"""Travel since a reversal, of the whole travel, below which it is all one."""


@dataclass(frozen=True, eq=False)
class Shape:
    """One family of curves.

    Attributes:
        variable: what the force is a function of, as printed.
        columns: force per amplitude at every sample, shape (n, p).
    """

    variable: str
    columns: NDArray[np.float64]


def shapes(signals: Signals) -> Iterator[Shape]:
    """Give all families of curves that the recording has the variable of, one after another: long ones are large."""
    direction = signals.direction
    since = signals.since_reversal_m
    curves = [
        ("speed", signals.speed_m_s, None),
        ("acceleration", signals.acceleration_m_s2, None),
        ("position", signals.position_m, None),
        ("position by direction", signals.position_m, direction),
        ("time", signals.t_s, None),
        ("time by direction", signals.t_s, direction),
    ]
    if len(signals.reversals):
        nearest = NEAREST_SHARE * signals.scale.travel_m
        after = np.isfinite(since)
        place = np.log(np.clip(np.where(after, since, np.inf), nearest, signals.scale.travel_m))
        curves.append(("travel since reversal", place, direction * after))
    for variable, values, factor in curves:
        columns = hats(values, *_range(values[signals.kept]))
        yield Shape(variable, columns if factor is None else columns * factor[:, None])


def hats(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.float64]:
    """Piecewise linear curves over a range, level beyond it, shape (n, 11)."""
    place = np.clip((values - low) / max(high - low, 1e-300), 0.0, 1.0) * (HATS - 1)
    return np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(HATS)))


def _range(values: NDArray[np.float64]) -> tuple[float, float]:
    return float(values.min()), float(values.max())
