"""Extremes of drawn noise by sector, and strips about drawn paths, by plain loops over the same draws."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.fft import next_fast_len
from scipy.optimize import linprog

from dbbstation.circles.extremes import BLOCKS, DRAWS, SEED, drawn_paths
from dbbstation.circles.form import drawn_lines, form_and_noise
from dbbstation.circles.strip import REACHED, strip_widths


# Fewer samples than sectors are kept behind a filter; 1009 is prime, so the draws are longer. All combinations run at night.
@pytest.mark.parametrize(
    ("count", "size", "upr", "sense"),
    [
        pytest.param(
            count,
            size,
            upr,
            sense,
            marks=() if (sense > 0.0) == ((upr == 0) == (count == 450)) else pytest.mark.nightly,
        )
        for count, size in ((450, 450), (1009, 1024))
        for upr in (0, 15)
        for sense in (1.0, -1.0)
    ],
)
def test_each_sector_has_the_extremes_of_its_samples_less_the_first_lines(sense, upr, count, size, rng) -> None:
    theta_deg = np.mod(40.0 + sense * np.sort(rng.uniform(0.0, 360.0, count)), 360.0)
    lines = np.arange(count // 2 + 1)
    passed = np.exp(-((lines / upr) ** 2)) if upr else np.ones(len(lines))
    apart = form_and_noise(rng.standard_normal(count))
    found = drawn_paths(apart, theta_deg, passed, 7, (2, 0))
    same = np.random.default_rng([SEED, 7])
    spectra = np.vstack([drawn_lines(apart, passed, (DRAWS // BLOCKS, size), same) for _ in range(BLOCKS)])
    for path, taken in zip(found, (2, 0), strict=True):
        noise = np.fft.irfft(np.where(lines < taken, 0.0, spectra), size, axis=1)
        edges = [*path.starts, len(path.order)]
        for sector, (begin, end) in enumerate(pairwise(edges)):
            samples = noise[:, path.order[begin:end] * size // count]
            assert path.highest_um[:, sector] == pytest.approx(samples.max(axis=1), abs=1e-12)
            assert path.lowest_um[:, sector] == pytest.approx(samples.min(axis=1), abs=1e-12)


@pytest.mark.parametrize("count", [1009, 2827])  # a prime, and 11 times 257
def test_longer_draws_have_the_variance_of_the_spectrum(count, rng) -> None:
    """The mean square of samples is the sum of both sides' powers over n [Parseval]."""
    apart = form_and_noise(rng.standard_normal(count))
    lines = np.arange(count // 2 + 1)
    apart = replace(apart, continued=replace(apart.continued, freedoms=np.full(len(apart.continued.weights), 1e9)))
    size = next_fast_len(count, real=True)
    drawn = np.fft.irfft(drawn_lines(apart, np.ones(len(lines)), (2000, size), rng), size, axis=1)
    low = apart.continued.powers.shape[1]
    power = np.concatenate([apart.continued.mean, apart.power_um2[low:]])
    wanted = (2.0 * power.sum() - power[0]) / count
    # A mean of independent squares has the relative standard error sqrt(2 / m); four of them.
    assert np.mean(drawn**2) == pytest.approx(wanted, rel=4.0 * np.sqrt(2.0 / (2000 * count)) + 2.0 / count)


def test_a_strip_is_as_wide_as_linear_programming_has_it(rng) -> None:
    """The least w with -w / 2 <= deviation - (r + a cos + b sin) <= w / 2 at all angles [Cheney, ch. 2]."""
    theta_deg = np.sort(rng.uniform(0.0, 360.0, 90))
    theta = np.radians(theta_deg)
    form = 3.0 * np.cos(2.0 * theta + 0.4) + 20.0 * np.cos(theta)
    outer = form + rng.normal(0.0, 1.0, (12, 90))
    inner = outer - np.abs(rng.normal(0.0, 1.0, (12, 90)))
    waves = np.column_stack([np.ones(90), np.cos(theta), np.sin(theta)])
    for high, low, width in zip(outer, inner, strip_widths(outer, inner, theta_deg), strict=True):
        sides = np.vstack([np.column_stack([-waves, -0.5 * np.ones(90)]), np.column_stack([waves, -0.5 * np.ones(90)])])
        solved = linprog([0.0, 0.0, 0.0, 1.0], A_ub=sides, b_ub=np.concatenate([-high, low]), bounds=[(None, None)] * 4)
        assert solved.fun * (1.0 - 1e-9) <= width <= solved.fun * (1.0 + 2.0 * REACHED)
