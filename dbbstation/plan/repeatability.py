"""A holder's repeatability: scatter over mountings, with uncertainty [CAL III-B].

A CMM measures n mountings per bore. Squared deviations from each place's mean are summed, with f degrees of freedom; f
s² / sigma² is chi-square [GUM E.4.3].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, fdtrc

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Floats

LEVEL = 0.95
"""Probability of the intervals, as that of U (k = 2)."""

UNLIKE_AXES = 0.01
"""Probability of a ratio between equal axes below which the difference is reported."""

FEWEST = 2
"""Fewest mountings of one place that show a scatter."""


@dataclass(frozen=True)
class HolderScatter:
    """A standard deviation with its interval.

    Attributes:
        standard_uncertainty_um: s / sqrt(2 f) [GUM E.4.3].
    """

    s_um: float
    low_um: float
    high_um: float
    standard_uncertainty_um: float
    degrees_of_freedom: int


@dataclass(frozen=True)
class HolderResult:
    """A holder's repeatability.

    Attributes:
        repeatability_um: standard deviation per axis, as in a jig file.
        rms_distance_um: distance from the mean place; estimates sigma sqrt(number of axes).
        mean_distance_um: corrected for the estimated mean place.
        p_axes_alike: probability of so large a variance ratio if the axes are equal.
        of_cmm_um: standard deviation of the CMM, already subtracted.
    """

    repeatability_um: float
    together: HolderScatter
    axes: Mapping[str, HolderScatter]
    level: float
    rms_distance_um: float
    mean_distance_um: float
    places: int
    mountings: int
    p_axes_alike: float
    of_cmm_um: float


def repeatability(places_um: Sequence[Floats], cmm_um: float = 0.0) -> HolderResult:
    """Return a holder's repeatability.

    Args:
        places_um: one array of measured centres per place, shape (n, 2) or (n, 3).
        cmm_um: standard deviation of repeated measurements of an untouched ball; its square is subtracted.

    Raises:
        ValueError: no place has two mountings.
    """
    several = [place for place in places_um if len(place) >= FEWEST]
    if not several:
        raise ValueError("each place has one mounting only: scatter needs two")
    off = [place - place.mean(axis=0) for place in several]
    squares = np.sum([np.sum(one**2, axis=0) for one in off], axis=0)
    freedom = sum(len(one) - 1 for one in off)
    axes = [scatter(float(total), freedom, cmm_um) for total in squares]
    together = scatter(float(squares.sum()), freedom * len(squares), cmm_um)
    # Distances from an estimated mean are too small by sqrt((n - 1) / n).
    distances = np.concatenate([np.linalg.norm(one, axis=1) * math.sqrt(len(one) / (len(one) - 1)) for one in off])
    return HolderResult(
        repeatability_um=together.s_um,
        together=together,
        axes=dict(zip("xyz", axes, strict=False)),
        level=LEVEL,
        rms_distance_um=math.sqrt(float(squares.sum()) / freedom),
        mean_distance_um=float(distances.mean()),
        places=len(several),
        mountings=len(distances),
        p_axes_alike=_axes_differ(squares, freedom),
        of_cmm_um=cmm_um,
    )


def scatter(squares_um2: float, freedom: int, cmm_um: float = 0.0) -> HolderScatter:
    """Return the standard deviation from a sum of squares, with its chi-square interval."""
    tail = (1.0 - LEVEL) / 2.0
    variances = (
        squares_um2 / freedom,
        squares_um2 / float(chdtri(freedom, tail)),
        squares_um2 / float(chdtri(freedom, 1.0 - tail)),
    )
    s_um, low_um, high_um = (math.sqrt(max(one - cmm_um**2, 0.0)) for one in variances)
    return HolderScatter(s_um, low_um, high_um, s_um / math.sqrt(2.0 * freedom), freedom)


def _axes_differ(squares: Floats, freedom: int) -> float:
    if squares.min() <= 0.0:
        return 1.0 if squares.max() <= 0.0 else 0.0
    pairs = len(squares) * (len(squares) - 1) / 2
    return min(1.0, 2.0 * pairs * float(fdtrc(freedom, freedom, squares.max() / squares.min())))
