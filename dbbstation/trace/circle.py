"""Circles cut from recordings: raw circles can calibrate a machine, centred circles cannot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.plan.circle import FULL_TURN_DEG
from dbbstation.trace.columns import WithLogged, each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats, Integers
    from dbbstation.plan.circle import Circle
    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class RawCircle(WithLogged):
    """One full turn of raw lengths in time order, shapes (n,).

    Attributes:
        t_s: since the recording's first sample.
        phi_deg: along the turn, 0 to 360.
        start_uncertainty_deg: standard uncertainty of the turn's start; zero with recorded angles.
    """

    name: str
    circle: Circle
    t_s: Floats
    phi_deg: Floats
    length_mm: Floats
    logged: Logged = field(default_factory=dict)
    start_uncertainty_deg: float = 0.0

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def theta_deg(self) -> Floats:
        """Return the angle from +X towards +Y, within 0 to 360 [deg]."""
        return np.mod(self.circle.theta_deg(self.phi_deg), 360.0)


@dataclass(frozen=True, eq=False)
class CentredCircle:
    """A circle after removal of its centre [CAL eq 6].

    Attributes:
        theta_deg: from +X towards +Y, shape (n,).
        deviation_mm: from the best-fit circle, shape (n,).
    """

    name: str
    circle: Circle
    theta_deg: Floats
    deviation_mm: Floats
    radius_mm: float


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
