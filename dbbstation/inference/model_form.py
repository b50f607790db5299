"""Inaccuracy of formulas, as effects modulated along a variable.

Smooth modulations represent it [Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425, sec. 4, on model discrepancy].
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import comb

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.computing.arrays import Flags, Floats

DEGREE = 3
"""Degree of the modulating polynomials: four functions over the range of a variable."""

ALONG_SCREWS = 8
"""Their degree for friction and wear of screws, which vary over some tens of millimetres: nine functions over the range.
Of spikes of 1.9 µm rms that vary in waves of 98 to 235 mm, degree 3 leaves 0.28 µm, 5 0.23, 8 0.16 and 12 0.13."""

LATER = 2.0
"""Possible delay of a transit after a reversal, in samples: a degree of the turn."""


def bernstein(values: Floats, low: float, high: float, degree: int = DEGREE) -> Floats:
    """Return Bernstein polynomials over a range, shape (..., degree + 1), summing to one [Farin, Curves and Surfaces for CAGD, 5th ed., eq 5.1]."""
    share = np.clip((values - low) / max(high - low, 1e-12), 0.0, 1.0)[..., None]
    k = np.arange(degree + 1)
    return comb(degree, k) * share**k * (1.0 - share) ** (degree - k)


def modulated(
    effects: Sequence[Floats],
    along: Sequence[Floats],
    signs: Sequence[Floats] | None,
    degree: int = DEGREE,
    *,
    each_side: bool = False,
) -> Floats:
    """Return effects of m actuators times smooth functions, over all runs, shape (n, q).

    Args:
        signs: directions of travel per run, shape (n, m); None if irrelevant.
        each_side: functions differ on both sides of zero.
    """
    effect, values = np.vstack(effects), np.vstack(along)
    ways = [np.ones_like(effect)] if signs is None else [np.vstack(signs) > 0.0, np.vstack(signs) <= 0.0]
    found = []
    for mover in range(effect.shape[1]):
        own, at = effect[:, mover], values[:, mover]
        if not own.any():
            continue
        sides = [at > 0.0, at <= 0.0] if each_side else [np.ones_like(at, dtype=bool)]
        functions = np.hstack([_within(at, side, degree) for side in sides if side.any()])
        found += [functions * (own * way[:, mover])[:, None] for way in ways]
        if signs is not None:
            found.append(_other_transits(effects, signs, mover))
    return np.hstack(found) if found else np.zeros((len(effect), 0))


def _within(values: Floats, side: Flags, degree: int) -> Floats:
    """Return Bernstein polynomials over some of the values, zero at the others, shape (n, degree + 1)."""
    low, high = float(values[side].min()), float(values[side].max())
    return bernstein(values, low, high, degree) * side[:, None]


def _other_transits(effects: Sequence[Floats], signs: Sequence[Floats], mover: int) -> Floats:
    """Return two changes of one effect, for an instantaneous and for a delayed transition after reversals, shape (n, 2)."""
    found = []
    for effect, sign in zip(effects, signs, strict=True):
        own, way = effect[:, mover], np.sign(sign[:, mover])
        level = float(own @ way) / max(float(way @ way), 1.0)
        found.append(np.column_stack([level * way, np.gradient(own) * LATER]))
    return np.vstack(found)
