"""Runs as recorded, the circles cut from them, and the session's temperature.

Raw circles can calibrate a machine, centred circles cannot.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.trace.columns import WithLogged, each

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Flags, Floats, Integers
    from dbbstation.plan.plan import Circle
    from dbbstation.trace.columns import Logged


@dataclass(frozen=True, eq=False)
class Recording(WithLogged):
    """Samples of one run in time order, shapes (n,).

    Attributes:
        t_s: host time since the first sample, strictly rising.
        length_mm: between ball centres, raw.
        theta_deg: commanded, from +X towards +Y, of a cut recording; None if the circle must be found in the trace.
        usable: False for bad and doubtful samples, which stay.
    """

    name: str
    t_s: Floats
    length_mm: Floats
    theta_deg: Floats | None = None
    logged: Logged = field(default_factory=dict)
    usable: Flags | None = None

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def good(self) -> Recording:
        """Return the usable samples, for all calculations."""
        # A recording that equals its good part is not cached: a reference to itself would delay freeing its memory.
        return self if self.usable is None or self.usable.all() else self._usable_rows

    @cached_property
    def _usable_rows(self) -> Recording:
        rows = self.usable
        return Recording(
            name=self.name,
            t_s=self.t_s[rows],
            length_mm=self.length_mm[rows],
            theta_deg=None if self.theta_deg is None else self.theta_deg[rows],
            logged=each(self.logged, lambda values: values[rows]),
        )


_OFF = 0.25
"""Largest deviation of a spacing from a whole number of periods [periods]; a device's clock deviates by hundredths."""

_REGULAR = 0.9
"""Share of all spacings, and of wide spacings, that must be whole periods before wide spacings count as losses."""


def lost_samples(t_s: Floats) -> int:
    """Return the number of samples missing from a fixed rate; 0 without a fixed rate."""
    if len(t_s) < _FEWEST:
        return 0
    periods = np.diff(t_s)
    periods /= np.median(periods)
    whole = np.round(periods)
    periods -= whole  # in place, because a recording may have ten million samples
    fits = np.abs(periods, out=periods) < _OFF
    wide = whole > 1.0
    if not wide.any() or np.mean(fits & (whole > 0.0)) < _REGULAR or np.mean(fits[wide]) < _REGULAR:
        return 0
    return int(np.sum(whole[wide] - 1.0))


def share_lost(lost: int, kept: int, unusable: int = 0) -> str:
    """Return the number of lost samples with their share, in words.

    Args:
        unusable: recorded but unusable, of these.
    """
    how = "were lost or cannot be used" if unusable else "were lost"
    return f"{lost} of {lost + kept} samples {how} ({100.0 * lost / (lost + kept):.2g} %)"


def too_many_lost(lost: int, kept: int, largest_percent: float, unusable: int = 0) -> str:
    """Return a message if too many samples are lost; else an empty text.

    Args:
        unusable: recorded but unusable, of these.
    """
    if 100.0 * lost <= largest_percent * (lost + kept):
        return ""
    return f"{share_lost(lost, kept, unusable)}, more than the {largest_percent:g} % that the plan allows"


AFTER_LOSS = "look after the cable and after programs that keep the computer busy, and repeat the run"
"""What to do about lost samples."""

_FEWEST = 10
"""Fewest samples that determine the rate."""


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


def logged_curve(
    runs: Sequence[tuple[Floats, Floats]],
) -> tuple[Floats, Floats]:
    """Return a session's temperature curve: rising times [s] and temperatures [degC], two points per run, shape (q,) each.

    Among all curves within half a display step of each half run's mean, the least bent is chosen. Changes within half a
    run are lost.
    """
    halves = [half for run in runs for half in zip(*(np.array_split(one, 2) for one in run), strict=True)]
    means = {float(one.mean()): float(degc.mean()) for one, degc in halves if len(one)}
    # Runs whose clock was set back in between overlap.
    time_s = np.array(sorted(means))
    shown = np.array([means[moment] for moment in time_s])
    half_step = 0.5 * _resolution(np.concatenate([degc for _, degc in runs]))
    gaps = np.diff(time_s)
    if len(time_s) < _BENDS or half_step < SHOWN_K:
        return time_s, shown
    slope = np.diff(np.eye(len(time_s)), axis=0) / gaps[:, None]
    bending = np.diff(slope, axis=0) / np.sqrt(0.5 * (gaps[1:] + gaps[:-1]))[:, None]
    # In units of half a display step about the displayed value, so bounds are plus and minus one.
    from scipy.optimize import lsq_linear  # noqa: PLC0415 - takes a fifth of a second; few sessions need it

    found = lsq_linear(bending * half_step, -bending @ shown, bounds=(-1.0, 1.0))
    return time_s, shown + half_step * found.x


_BENDS = 3
"""Fewest points of a curve that can be bent."""

SHOWN_K = 1e-3
"""Finest display step of a thermometer, as in recordings [K]."""


def _resolution(degc: Floats) -> float:
    """Return the greatest common divisor of displayed differences [K]; zero for one value."""
    steps = np.diff(np.unique(np.round(degc / SHOWN_K).astype(np.int64)))
    return SHOWN_K * float(np.gcd.reduce(steps)) if len(steps) else 0.0
