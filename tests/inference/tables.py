"""Simulated tables of residuals, written without the package: variables of a moving axis, and one effect each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

STEP_S = 0.05
ROWS = 1500


@dataclass(frozen=True, eq=False)
class Table:
    """Variables and residual of one table; blocks are as long as each other."""

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    angle: NDArray[np.float64]
    load: NDArray[np.float64]
    temperature: NDArray[np.float64]
    simulated: NDArray[np.float64]
    residual: NDArray[np.float64]


def table(
    seed: int,
    effect: Callable[[Table], NDArray[np.float64]] | None = None,
    *,
    noise: float = 0.1,
    correlation: float = 0.0,
    rows: int | None = None,
) -> Table:
    """A table with noise, white or of a first-order process with so much of each value in the next one; `ROWS` rows without a number."""
    rows = rows or ROWS
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * STEP_S
    q = 30.0 * np.sin(0.69 * t) + 20.0 * np.sin(0.27 * t + 1.0)
    angle = np.mod(37.0 * t + 20.0 * np.sin(0.2 * t), 360.0)
    load = 5.0 * np.sin(0.195 * t + 0.3)
    temperature = 20.0 + 2.0 * (1.0 - np.exp(-t / 30.0)) + 0.05 * rng.standard_normal(rows)
    simulated = 0.1 * q + 0.001 * np.cumsum(q)
    white = rng.standard_normal(rows)
    values = np.empty(rows)
    values[0] = white[0]
    for k in range(1, rows):
        values[k] = correlation * values[k - 1] + np.sqrt(1.0 - correlation**2) * white[k]
    found = Table(t, q, angle, load, temperature, simulated, noise * values)
    if effect is None:
        return found
    return Table(t, q, angle, load, temperature, simulated, noise * values + effect(found))


def direction(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """1 while it rises, -1 while it falls."""
    change = np.diff(values, prepend=2.0 * values[0] - values[1])
    return np.where(change > 0.0, 1.0, -1.0)
