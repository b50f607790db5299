"""A run as recorded, and the samples that it lacks."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.trace.columns import WithLogged, each

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats
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


@dataclass(frozen=True, eq=False)
class DriveRecording:
    """Samples of one drive, in time order.

    Attributes:
        position_mm: along the axis, shape (n,).
        force_n: driving, positive towards greater positions, shape (n,).
    """

    name: str
    t_s: Floats
    position_mm: Floats
    force_n: Floats

    def __len__(self) -> int:
        return len(self.t_s)


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
