"""The results of `jig`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.plan.repeatability import LEVEL

if TYPE_CHECKING:
    from dbbstation.plan.repeatability import Repeatability, Scatter


@dataclass(frozen=True)
class MeasuredBall:
    """A measured ball.

    Attributes:
        centre_mm: X, Y, Z in the jig's frame.
        change_um: against the former jig, X, Y, Z; None for a new ball.
    """

    centre_mm: tuple[float, ...]
    change_um: tuple[float, ...] | None


@dataclass(frozen=True)
class SheetResult:
    """What `jig sheet` wrote."""

    jig: str
    balls: Mapping[str, MeasuredBall]
    not_in_the_sheet: tuple[str, ...]


@dataclass(frozen=True)
class HolderScatter:
    """A standard deviation with its interval."""

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
        axes: x, y and, if measured, z.
        level: probability of the intervals.
        rms_distance_um: from the mean place.
        p_axes_alike: probability of so large a ratio of variances for equal axes.
        of_cmm_um: subtracted standard deviation of the CMM.
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


@dataclass(frozen=True)
class HoldersResult:
    """What `jig holders` found.

    Attributes:
        jig: written file, or None.
    """

    holders: Mapping[str, HolderResult]
    jig: str | None


def holder_result(one: Repeatability) -> HolderResult:
    """Return a holder's repeatability."""
    return HolderResult(
        repeatability_um=one.together.s_um,
        together=_scatter(one.together),
        axes={axis: _scatter(scatter) for axis, scatter in zip("xyz", one.axes, strict=False)},
        level=LEVEL,
        rms_distance_um=one.rms_distance_um,
        mean_distance_um=one.mean_distance_um,
        places=one.places,
        mountings=one.mountings,
        p_axes_alike=one.axes_differ,
        of_cmm_um=one.of_cmm_um,
    )


def _scatter(one: Scatter) -> HolderScatter:
    return HolderScatter(one.s_um, one.low_um, one.high_um, one.u_um, one.freedom)
