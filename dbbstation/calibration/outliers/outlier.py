"""Outliers among a session's runs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import sqrt
from typing import TYPE_CHECKING, Annotated

import numpy as np

from dbbstation.facts.serialise import Kept

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation

    Fit = Callable[[Sequence[Observation]], Calibration]
    Step = tuple["Outlier", list[Observation], Calibration]

STANDS_OUT = 4.0
"""A run is an outlier if its residual is this many times the usual residual ..."""

LEAST_UM = 3.0
"""... and larger than a bar's noise can be [µm]."""


class OutlierKind(StrEnum):
    """Kinds of outliers."""

    RUN = "run"
    WRONG_PLACE = "wrong-place"
    MOVED = "moved"
    MOUNTING = "mounting"
    BALL = "ball"
    BAR = "bar"


SOURCE_OF = {
    OutlierKind.MOUNTING: "mounting",
    OutlierKind.MOVED: "mounting",
    OutlierKind.BALL: "ball-coordinate",
    OutlierKind.WRONG_PLACE: "ball-coordinate",
    OutlierKind.BAR: "bar-offset",
}
"""Error source with a value beyond its stated size; a run that is no circle of this machine has no such source."""


@dataclass(frozen=True, kw_only=True)
class Outlier:
    """An outlier whose influence on the fit is removed.

    Attributes:
        test: name of the test, or of the session for a bar.
        size_um: residual rms of a run, displacement of a ball, or length error of a bar.
        shift_um: of a ball, machine axes; None for a run.
        sure: False if a single mounting cannot distinguish a badly seated ball from a wrong CMM row.
        alike: other error sources that explain it about equally well.
        freed: mountings with free ball, or session with free bar.
    """

    kind: OutlierKind
    test: str
    runs: str
    size_um: float
    uncertainty_um: float | None = None
    shift_um: tuple[float, float, float] | None = None
    text: str
    sure: Annotated[bool, Kept] = True
    alike: Annotated[tuple[str, ...], Kept] = ()
    freed: Annotated[tuple[str, ...], Kept] = ()
    why: Annotated[str, Kept] = ""


def left_of(calibration: Calibration) -> list[tuple[Observation, Floats]]:
    """Yield every run with its residual, shape (n,) [mm]."""
    return list(zip(calibration.observations, calibration.residual_mm, strict=True))


def shift_of(observation: Observation, residual: Floats) -> Floats:
    """Return the ball's shift that best explains a residual, in X and Y, shape (2,) [mm]."""
    return -np.asarray(np.linalg.lstsq(_harmonics(observation), residual, rcond=None)[0][:2], dtype=np.float64)


def without_shift(observation: Observation, residual: Floats) -> Floats:
    """Return a residual, shape (n,) [mm], less its best in-plane shift."""
    columns = _harmonics(observation)[:, :2]
    return residual - columns @ np.linalg.lstsq(columns, residual, rcond=None)[0]


def rms_um(residual: Floats) -> float:
    """Return the root mean square [µm] of a residual [mm]."""
    return 1e3 * sqrt(np.mean(residual**2))


def _harmonics(observation: Observation) -> Floats:
    theta = np.radians(observation.raw.theta_deg)
    flat = np.cos(np.radians(observation.raw.circle.elevation_deg))
    return np.column_stack([flat * np.cos(theta), flat * np.sin(theta), np.ones(len(theta))])
