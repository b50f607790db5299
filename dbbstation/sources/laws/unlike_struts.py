"""Struts whose contacts differ, where a law has one length for all of them."""

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
"""Times the common length that a strut's own may be, one standard deviation: preload, wear and grease differ from drive to drive."""


def of_own_lengths(source: ErrorSource, motion: Motion, machine: Machine, values: Floats) -> Effect:
    """Return changes of a source of struts if each has a length of its own.

    Args:
        values: of each strut, then the length that they share, shape (7,).
    """

    def of_times(times: float) -> Floats:
        other = values.copy()
        other[STRUTS] *= times
        return np.asarray(source.effect(motion, machine, other).strut_mm, dtype=np.float64)

    return Effect(strut_mm=0.5 * (of_times(UNLIKE) - of_times(1.0 / UNLIKE))[:, :, None] * np.eye(STRUTS))
