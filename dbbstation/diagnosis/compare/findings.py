"""Findings of a comparison, B minus A; fields are JSON keys."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from dbbstation.computing.arrays import Floats
from dbbstation.diagnosis.compare.pairs import Pair
from dbbstation.diagnosis.findings import ArcOfRun
from dbbstation.facts.serialise import AsItIs, Kept


@dataclass(frozen=True, kw_only=True, eq=False)
class RunDifference:
    """The difference of one run, B minus A.

    Attributes:
        differs: whether the found effects are certain in this run.
        found_rms_um: rms effect of found causes.
        rms_um: of the smooth difference, up to its highest harmonic.
        noise_rms_um: of the smooth difference.
        centre_shift_uncertainty_um: from noise and stated balls.
        mean_radial_change_uncertainty_um: from noise, stated bars, and balls of raised bars.
        circularity_um: range of the difference about its centre.
        smooth_mm: smoothed difference, shape (s,).
        found_mm: effect of found causes, shape (s,).
    """

    test: str
    direction: str
    number: int
    repeats_a: tuple[int, ...]
    repeats_b: tuple[int, ...]
    differs: bool
    found_rms_um: float
    found_sigmas: float
    rms_um: float
    noise_rms_um: float
    centre_shift_um: tuple[float, float]
    centre_shift_uncertainty_um: float
    mean_radial_change_um: float
    mean_radial_change_uncertainty_um: float
    circularity_um: float
    peak_um: float
    peak_theta_deg: float
    by_angle_um: tuple[float, ...]
    pair: Annotated[Pair, AsItIs, Kept]
    smooth_mm: Annotated[Floats, AsItIs, Kept]
    found_mm: Annotated[Floats, AsItIs, Kept]


@dataclass(frozen=True)
class DirectionHalves:
    """Parts of the difference with equal and with opposite sign in both directions.

    Attributes:
        opposite_um: rms of the part with changing sign.
    """

    same_um: float
    opposite_um: float


@dataclass(frozen=True)
class LargestEffect(ArcOfRun):
    """The arc of a cause's largest effect, with at least half the peak."""

    peak_um: float
    text: str


@dataclass(frozen=True)
class EffectOfCause:
    """A cause's effect on the difference.

    Attributes:
        share: of the total chi-square reduction, for this cause alone.
        taken_up: share of squares that a kinematic calibration of B absorbs.
        opposite: share of squares that change sign with direction, over tests run in both.
    """

    rms_um: float
    share: float
    taken_up: float
    opposite: float
    where: LargestEffect
