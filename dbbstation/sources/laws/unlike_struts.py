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

OTHERS = (0.5, 0.71, 1.41, 2.0)
"""Ratios of a strut's length to the common length: preload, wear and grease differ between drives. Halves of an octave
leave 3e-4 of a turn-round between them."""


def of_own_lengths(source: ErrorSource, motion: Motion, machine: Machine, values: Floats) -> Effect:
    """Return changes of a source's effect if each strut has its own length, or several at once.

    Friction whose parts give way after different travels is a sum over lengths [Prandtl and Ishlinskii; Visintin,
    Differential Models of Hysteresis (1994), sec. III.2].

    Args:
        values: one per strut, then the common length, shape (7,).
    """

    def of_times(times: float) -> Floats:
        other = values.copy()
        other[STRUTS] *= times
        return np.asarray(source.effect(motion, machine, other).strut_mm, dtype=np.float64)

    common = of_times(1.0)
    changes = [(of_times(times) - common)[:, :, None] * np.eye(STRUTS) for times in OTHERS]
    return Effect(strut_mm=np.concatenate(changes, axis=2))
