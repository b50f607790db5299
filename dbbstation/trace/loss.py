"""Samples that a recording lacks: what the line or a busy computer lost between two that came."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_OFF = 0.25
"""How far a spacing may be from a whole number of periods [periods]: a device's own clock keeps to hundredths."""

_REGULAR = 0.9
"""Share of spacings, and of wide ones, that must be whole numbers of periods for wide ones to be losses."""


def lost_samples(t_s: NDArray[np.float64]) -> int:
    """Return how many samples are missing between the first and the last, as far as their times show it.

    A device that samples at a fixed rate leaves whole periods where samples were lost. Times without a fixed rate, such
    as those of a computer that asks when it has time, show nothing: 0.

    Args:
        t_s: times of the samples, rising, shape (n,) [s].
    """
    if len(t_s) < _FEWEST:
        return 0
    periods = np.diff(t_s)
    periods /= np.median(periods)
    whole = np.round(periods)
    periods -= whole  # in its place: a recording may have ten million samples
    fits = np.abs(periods, out=periods) < _OFF
    wide = whole > 1.0
    if not wide.any() or np.mean(fits & (whole > 0.0)) < _REGULAR or np.mean(fits[wide]) < _REGULAR:
        return 0
    return int(np.sum(whole[wide] - 1.0))


def share_lost(lost: int, kept: int, unusable: int = 0) -> str:
    """Return how many samples were lost, in words with the share of all.

    Args:
        unusable: of the missing ones, how many are recorded but cannot be used.
    """
    how = "were lost or cannot be used" if unusable else "were lost"
    return f"{lost} of {lost + kept} samples {how} ({100.0 * lost / (lost + kept):.2g} %)"


def too_many_lost(lost: int, kept: int, largest_percent: float, unusable: int = 0) -> str:
    """Return what is wrong with a run that lost so many samples; empty where that is within the limit.

    Args:
        unusable: of the lost ones, how many are recorded but cannot be used.
    """
    if 100.0 * lost <= largest_percent * (lost + kept):
        return ""
    return f"{share_lost(lost, kept, unusable)}, more than the {largest_percent:g} % that the plan allows"


AFTER_LOSS = "look after the cable and after programs that keep the computer busy, and repeat the run"
"""What to do about lost samples."""

_FEWEST = 10
"""Samples below which there is no telling what the rate was."""
