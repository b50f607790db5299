"""Separate a circle's deviations into form and noise."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.circles.continued import continued_noise
from dbbstation.circles.pushes import NO_TAILS, pushes_of
from dbbstation.computing.arrays import average_of, median_of, place_of_largest
from dbbstation.inference.harmonics import bands

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from dbbstation.circles.continued import ContinuedNoise
    from dbbstation.circles.pushes import Pushes
    from dbbstation.computing.arrays import Flags, Floats

CHANCE = 0.01
"""Probability that noise alone has a line that counts as form."""

NEIGHBOURS = 15
"""Lines on each side over which noise power is averaged, because it changes slowly along the spectrum."""


@dataclass(frozen=True, eq=False)
class FormAndNoise:
    """Form and noise of deviations round a turn.

    Attributes:
        form_um: deviations without separable noise, shape (n,).
        power_um2: noise at lines 0, 1, ... n // 2, as the variance of white noise of equal power.
        continued: extrapolated noise at the low lines.
    """

    form_um: Floats
    power_um2: Floats
    continued: ContinuedNoise
    pushes: Pushes = NO_TAILS


def form_and_noise(deviation_um: Floats) -> FormAndNoise:
    """Separate form and noise of a series of deviations.

    Args:
        deviation_um: about equally spaced over a turn, shape (n,).
    """
    # Noise is measured above 30 undulations per revolution and extrapolated below (`dbbstation.inference.harmonics`).
    # There, a line of power P over noise S has the form share 1 - S / P. Outstanding lines above are form.
    count = len(deviation_um)
    low, high = bands(count)
    above = np.fft.rfft(deviation_um)
    above[: low + 1] = 0.0
    sharp = _sharp(np.fft.irfft(above, count), low)
    lines = np.fft.rfft(deviation_um - sharp)
    power = np.abs(lines) ** 2 / count
    floor, standing = _floor(power[low + 1 :])
    continued = continued_noise(power[: low + 1], floor[: high - low])
    noise = np.concatenate([continued.usual, _averaged(floor)])
    share = np.maximum(power - noise, 0.0) / np.maximum(power, np.finfo(float).tiny)
    share[: low + 1] *= power[: low + 1] > STANDS_OUT * noise[: low + 1]
    share[0] = 1.0  # the radius has less noise than a sample, so the mean counts as form
    share[low + 1 :] *= standing
    if low > 1 and not (share[2:].any() or sharp.any()):
        strongest = 2 + place_of_largest(power[2 : low + 1] / np.maximum(noise[2 : low + 1], np.finfo(float).tiny))
        share[strongest] = 1.0  # without outstanding lines, the strongest is most probably form
    white = np.where(share > 0.0, 0.0, lines / np.sqrt(count * np.maximum(noise, np.finfo(float).tiny)))
    white[: low + 1] = 0.0
    return FormAndNoise(np.fft.irfft(share * lines, count) + sharp, noise, continued, pushes_of(white, count))


STANDS_OUT = 3.0
"""Limit of noise, in mean powers. A noise line's power is exponentially distributed: one in twenty exceeds three means.
Weaker lines count as noise alone; otherwise noise left in the form would count twice."""


def _sharp(quick_um: Floats, low: int) -> Floats:
    """Return short local form, such as a reversal spike, shape (n,)."""
    # A Gaussian filter with four times the low cut-off smooths the deviations; values beyond the noise limit are form.
    # Medians of three readings suppress single outliers.
    count = len(quick_um)
    passed = np.exp2(-((np.arange(count // 2 + 1.0) / (4.0 * low)) ** 2))
    smooth, beside = (
        np.fft.irfft(np.fft.rfft(values) * passed, count)
        for values in (quick_um, np.median([np.roll(quick_um, 1), quick_um, np.roll(quick_um, -1)], axis=0))
    )
    usual = median_of(np.abs(beside)) / MEDIAN_OF_NORMAL
    out = np.abs(beside) > usual * sqrt(2.0 * np.log(8.0 * low / CHANCE))
    if not out.any():
        return np.zeros(count)
    reach = max(count // (4 * low), 1)
    near = np.convolve(np.tile(out, 3), np.ones(2 * reach + 1), mode="same")[count : 2 * count] > 0.0
    return np.where(near, smooth, 0.0)


MEDIAN_OF_NORMAL = 0.6745
"""Median absolute value of a standard normal variable."""


def _floor(power: Floats) -> tuple[Floats, Flags]:
    standing = np.zeros(len(power), dtype=bool)
    limit = np.log(max(len(power), 1) / CHANCE)  # a noise line's power is exponentially distributed
    floor = power
    for _ in range(_ROUNDS):
        usual = _averaged(np.where(standing, np.nan, power))
        found = standing | (power > limit * usual)
        if np.array_equal(found, standing):
            break
        standing = found
        floor = np.where(standing, _averaged(np.where(standing, np.nan, power)), power)
    return floor, standing


_ROUNDS = 20


def _averaged(power: Floats) -> Floats:
    known = np.isfinite(power)
    window = np.ones(min(2 * NEIGHBOURS + 1, len(power)))
    total = np.convolve(np.where(known, power, 0.0), window, mode="same")
    of = np.convolve(known.astype(float), window, mode="same")
    everywhere = average_of(power[known]) if known.any() else 0.0
    return np.where(of > 0.0, total / np.maximum(of, 1.0), everywhere)


def drawn_lines(
    apart: FormAndNoise, passed: Floats, shape: tuple[int, int], rng: np.random.Generator
) -> NDArray[np.complex128]:
    """Return drawn noise spectra, as of `numpy.fft.rfft`, shape (draws, n // 2 + 1) [µm].

    Args:
        passed: amplitude that the filter passes, by line, shape (n // 2 + 1,).
        shape: draws, and length of the inverse transform, at least n.
    """
    lines = np.fft.rfft(apart.pushes.drawn(rng, *shape), axis=1)[:, : len(passed)]
    lines *= np.sqrt(shape[1] / len(apart.form_um))
    below = apart.continued.drawn(rng, shape[0])
    seen = below.shape[1]
    lines[:, :seen] *= np.sqrt(below) * passed[:seen]
    lines[:, seen:] *= np.sqrt(apart.power_um2[seen:]) * passed[seen:]
    return lines
