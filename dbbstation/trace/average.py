"""Averages of a raw circle over equal sectors."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.columns import each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.trace.circle import RawCircle


def sector_of(raw: RawCircle, sectors: int) -> Integers:
    """Return every sample's sector, from 0 without gaps, shape (n,)."""
    sector = np.minimum((raw.phi_deg * (sectors / FULL_TURN_DEG)).astype(np.int64), sectors - 1)
    _, counted = np.unique(sector, return_inverse=True)
    return counted.astype(np.int64)


def averaged(raw: RawCircle, sectors: int) -> RawCircle:
    """Return a raw circle with one mean sample per sector."""
    sector = sector_of(raw, sectors)
    return replace(
        raw,
        t_s=means(raw.t_s, sector),
        phi_deg=means(raw.phi_deg, sector),
        length_mm=means(raw.length_mm, sector),
        logged=each(raw.logged, lambda values: means(values, sector)),
    )


def means(values: Floats, group: Integers) -> Floats:
    """Return the mean row of each group, shape (groups, ...); groups are numbered from 0 without gaps."""
    count = np.bincount(group)
    if values.ndim == 1:
        return np.bincount(group, values) / count
    return np.column_stack([np.bincount(group, column) / count for column in values.T])


def by_angle(raw: RawCircle, curves: Sequence[Floats], sectors: int) -> tuple[Floats, list[Floats]]:
    """Return rising angles from +X towards +Y [deg] and sector means of curves, shape (s,) each, for drawing."""
    sector = sector_of(raw, sectors)
    theta = np.mod(raw.circle.theta_deg(means(raw.phi_deg, sector)), FULL_TURN_DEG)
    order = np.argsort(theta)
    return theta[order], [means(curve, sector)[order] for curve in curves]
