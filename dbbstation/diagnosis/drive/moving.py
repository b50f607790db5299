"""Weights of samples in the comparison, and their effect on noise.

Friction at standstill is a reaction force without a law. If F is a sum of columns wherever the weight w is nonzero, the
equation also holds for low-passed weighted columns,

h * (w F) = sum of theta_k h * (w phi_k),

for any force at w = 0. Divided by h * w, each term is a local mean over moving samples. [Normalized convolution:
Knutsson and Westin, CVPR 1993, 515, eq. 4]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.signal import butter, sosfiltfilt

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Flags, Floats, Integers

ORDER = 4
"""Order of the Butterworth filters; doubled by both passes."""

POSITION_BAND = 2.0
"""Cut-off of the position's filter over the comparison's cut-off, so it is flat in the compared band."""

EDGE_PERIODS = 3.0
"""Duration of the filters' ringing, in cut-off periods."""


def low_passed(columns: Floats, rate_hz: float, cutoff_hz: float) -> Floats:
    """Low-pass columns, shape (n,) or (n, p), without phase shift; beyond the ends they are constant."""
    bands = (cutoff_hz, POSITION_BAND * cutoff_hz)
    sos = np.vstack([butter(ORDER, band, fs=rate_hz, output="sos") for band in bands])
    beyond = min(_reach(rate_hz, cutoff_hz), len(columns) - 1)
    return sosfiltfilt(sos, columns, axis=0, padtype="constant", padlen=beyond)


def impulse_response(rate_hz: float, cutoff_hz: float) -> Floats:
    """Return `low_passed` of an impulse, shape (2 k + 1,)."""
    reach = _reach(rate_hz, cutoff_hz)
    at = np.arange(-2 * reach, 2 * reach + 1)
    return low_passed((at == 0).astype(np.float64), rate_hz, cutoff_hz)[reach:-reach]


def _reach(rate_hz: float, cutoff_hz: float) -> int:
    return int(np.ceil(EDGE_PERIODS * rate_hz / cutoff_hz))


def speed_noise_m_s(noise_m: float, rate_hz: float, half: int) -> float:
    """Return noise of a slope over 2 `half` + 1 samples [m/s]."""
    return float(noise_m * rate_hz * np.sqrt(3.0 / (half * (half + 1) * (2 * half + 1))))


def half_window(noise_m: float, rate_hz: float, allowed_m_s: float, most: int) -> int:
    """Return the half-width of the shortest window whose slope noise is permitted; at most `most`."""
    fine = (half for half in range(1, most) if speed_noise_m_s(noise_m, rate_hz, half) <= allowed_m_s)
    return next(fine, most)


def within(marked: Flags, by: int) -> Flags:
    """Mark samples within `by` samples of marked ones, shape (n,)."""
    count = np.concatenate([[0], np.cumsum(marked)])
    at = np.arange(len(marked))
    return count[np.minimum(at + by + 1, len(marked))] > count[np.maximum(at - by, 0)]


def weights(unknown: Flags, rise: int) -> Floats:
    """Return weights, shape (n,): zero for unknown forces, with gradual rise to one."""
    if not unknown.any():
        return np.ones(len(unknown))
    away = distance_transform_edt(~unknown)
    return np.sin(0.5 * np.pi * np.minimum(away / (rise + 1), 1.0)) ** 2


def rise_of_weights(noise_m: float, rate_hz: float, cutoff_hz: float, allowed_m_s2: float, most: int) -> int:
    """Return the shortest rise of weights [samples] that limits edge noise in the acceleration."""
    response = impulse_response(rate_hz, cutoff_hz)
    at = np.arange(len(response)) - len(response) // 2
    own, unit = _of_second_difference(response), noise_m * rate_hz**2
    for rise in range(most):
        # The edge is assumed in the middle of the filter's response, the worst case.
        edge = weights(at <= -((rise + 1) // 2), rise)
        if unit**2 * (_of_second_difference(response * edge) - own) <= allowed_m_s2**2:
            return rise
    return most


def edge_noise_m_s2(weight: Floats, kept: Integers, noise_m: float, rate_hz: float, cutoff_hz: float) -> Floats:
    """Return the excess acceleration noise of compared samples.

    Returns:
        shape (m,) [m/s²].
    """
    response = impulse_response(rate_hz, cutoff_hz)
    reach = len(response) // 2
    around = np.pad(weight, reach, mode="edge")
    own = _of_second_difference(response)
    more = np.zeros(len(kept))
    for row, first in enumerate(kept):
        near = around[first : first + len(response)]
        if near.min() < 1.0:
            more[row] = _of_second_difference(response * near / float(response @ near)) - own
    return noise_m * rate_hz**2 * np.sqrt(np.maximum(more, 0.0))


def _of_second_difference(row: Floats) -> float:
    """Return the variance of weighted second differences of unit white noise."""
    return float(np.sum(np.diff(np.pad(row, 2), 2) ** 2))
