"""Speeds of struts along a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.machine.geometry import Machine
    from dbbstation.sources.contract import Motion

SHORTEST_S = 1e-6
"""Rows closer in time than this are one row, because their difference is rounding [s]."""


def driven_in_time(motion: Motion, machine: Machine) -> tuple[Floats, Floats, Integers]:
    """Return commanded strut lengths at strictly ascending times.

    Returns:
        Times, shape (m,) [s], lengths at these times, shape (m, 6) [mm], and each row's index among them, shape (n,).
        Of several rows at one time the last one counts.
    """
    time_s = np.asarray(motion.time_s)
    length = motion.struts(machine).length_mm
    later = np.diff(time_s) > SHORTEST_S
    return (
        time_s[np.append(later, True)],
        length[np.append(later, True)],
        np.concatenate([[0], np.cumsum(later)]),
    )


def speed_mm_s(time_s: Floats, length_mm: Floats) -> Floats:
    """Return speeds at ascending times, exact to second order, shape (m, 6) [mm/s]; zero for one row."""
    rows = len(time_s)
    if rows == 1:
        return np.zeros_like(length_mm)
    # At the ends, use a parabola through three rows.
    speed: Floats = np.gradient(length_mm, time_s, axis=0, edge_order=1 if rows == 2 else 2)  # noqa: PLR2004
    return speed
