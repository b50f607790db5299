"""Types of arrays, whose docstrings state their shapes, and numbers of arrays as plain numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

Floats: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]


def norm_of(values: Floats | Sequence[float]) -> float:
    """Return the Euclidean norm."""
    return float(np.linalg.norm(values))


def hypot_of(a: float, b: float) -> float:
    """Return the root of the sum of two squares."""
    return float(np.hypot(a, b))


def median_of(values: Floats | Sequence[float]) -> float:
    """Return the median."""
    return float(np.median(values))


def average_of(values: Floats | Sequence[float]) -> float:
    """Return the mean."""
    return float(np.mean(values))


def range_of(values: Floats | Sequence[float]) -> float:
    """Return the greatest less the least value."""
    return float(np.ptp(values))


def place_of_largest(values: Floats | Flags | Sequence[float]) -> int:
    """Return the index of the greatest value."""
    return int(np.argmax(values))


def sum_of(values: Floats | Integers | Flags) -> float:
    """Return the sum."""
    return float(np.sum(values))


def largest_size(values: Floats | Sequence[float]) -> float:
    """Return the greatest absolute value."""
    return float(np.abs(values).max())
