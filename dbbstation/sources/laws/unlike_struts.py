"""Differences between struts for laws with one common length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import ErrorSource, Motion

UNLIKE = 2.0
"""Ratio of a strut's length to the common length, one standard deviation: preload, wear and grease differ between drives."""


def of_own_lengths(source: ErrorSource, motion: Motion, machine: Machine, values: Floats) -> Effect:
    """Return changes of a source's effect if each strut's length differs from the common one.

    Args:
        values: one per strut, then the common length, shape (7,).
    """

    def of_times(times: float) -> Floats:
        other = values.copy()
        other[STRUTS] *= times
        return np.asarray(source.effect(motion, machine, other).strut_mm, dtype=np.float64)

    return Effect(strut_mm=0.5 * (of_times(UNLIKE) - of_times(1.0 / UNLIKE))[:, :, None] * np.eye(STRUTS))
