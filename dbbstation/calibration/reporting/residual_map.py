"""A model's residual of every run over test and angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.computing.threads import with_one_thread
from dbbstation.inference.harmonics import smooth
from dbbstation.plan.circle import Direction

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation

SECTORS = 36
"""Means of ten degrees."""


@dataclass(frozen=True, eq=False)
class ResidualMap:
    """Mean smooth residuals over test and angle.

    Attributes:
        um: arrays by direction, shape (tests, 36) each [µm]: rows are tests, columns angles from +X towards +Y; NaN for gaps.
    """

    tests: tuple[str, ...]
    um: Mapping[Direction, Floats]

    @property
    def reach_um(self) -> float:
        """Return the greatest absolute value [µm]."""
        return float(np.nanmax(np.abs(np.concatenate(list(self.um.values())))))


@with_one_thread
def residual_map(observations: Sequence[Observation], residual_mm: Sequence[Floats]) -> ResidualMap:
    """Return residuals without noise, averaged over ten degrees."""
    names = names_of_tests(observations)
    rows = {name: k for k, name in enumerate(dict.fromkeys(names))}
    um = {direction: np.full((len(rows), SECTORS), np.nan) for direction in Direction}
    for observation, residual, name in zip(observations, residual_mm, names, strict=True):
        um[observation.raw.circle.direction][rows[name]] = _by_angle_um(observation, residual)
    return ResidualMap(tuple(rows), um)


def names_of_tests(observations: Sequence[Observation]) -> list[str]:
    """Return each run's label: its test, with a number if repeated and the session if there are several."""
    repeated = any(o.repeat > 1 for o in observations)
    several = len({o.setup.session for o in observations}) > 1
    return [
        (f"{o.setup.session} " if several else "") + o.test + (f" {o.repeat}" if repeated else "") for o in observations
    ]


def _by_angle_um(observation: Observation, residual_mm: Floats) -> Floats:
    curve = smooth(residual_mm, np.radians(observation.raw.phi_deg))
    sector = (observation.raw.theta_deg * (SECTORS / 360.0)).astype(np.int64) % SECTORS
    count = np.bincount(sector, minlength=SECTORS)
    sums = np.bincount(sector, curve, minlength=SECTORS)
    return np.where(count > 0, 1e3 * sums / np.maximum(count, 1), np.nan)
