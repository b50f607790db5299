"""First-order memory: what follows its cause with one time constant."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
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
