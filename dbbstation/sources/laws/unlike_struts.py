"""Differences between struts for laws with one common length."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dbbstation.machine.geometry import STRUTS
from dbbstation.sources.contract import Effect, of_own_strut

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import ErrorSource, Motion

UNLIKE = 2.0
"""Ratio of a strut's length to the common length, one standard deviation: preload, wear and grease differ between drives."""

HALVES = (0.5, 0.71, 1.41, 2.0)
"""Ratios of lengths to the common length, half an octave apart: sums of wind-ups over them come within 3e-4 of one over any
length between."""


def of_own_lengths(source: ErrorSource, motion: Motion, machine: Machine, values: Floats) -> Effect:
    """Return changes of a source's effect if each strut's length differs from the common one.

    Args:
        values: one per strut, then the common length, shape (7,).
    """
    longer, shorter = (_of_times(source, motion, machine, values, times) for times in (UNLIKE, 1.0 / UNLIKE))
    return Effect(strut_mm=of_own_strut(0.5 * (longer - shorter)))


def of_several_lengths(source: ErrorSource, motion: Motion, machine: Machine, values: Floats) -> Effect:
    """Return changes of a source's effect if parts of each strut's friction have their own lengths.

    Bristles or contacts in parallel, which give way after different travels, are a sum over lengths [Prandtl and
    Ishlinskii; Visintin, Differential Models of Hysteresis (1994), sec. III.2].

    Args:
        values: as for `of_own_lengths`.
    """
    common = _of_times(source, motion, machine, values, 1.0)
    others = [_of_times(source, motion, machine, values, times) - common for times in HALVES]
    return Effect(strut_mm=np.concatenate([of_own_strut(other) for other in others], axis=2))


def _of_times(source: ErrorSource, motion: Motion, machine: Machine, values: Floats, times: float) -> Floats:
    other = values.copy()
    other[STRUTS] *= times
    return np.asarray(source.effect(motion, machine, other).strut_mm, dtype=np.float64)
