"""Samples missing between recorded ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats

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
