"""Extremes of drawn noise by sector, and strips about drawn paths, by plain loops over the same draws."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import linprog

from dbbstation.circles.extremes import BLOCKS, DRAWS, SEED, drawn_paths
from dbbstation.circles.form import drawn_lines, form_and_noise
from dbbstation.circles.strip import REACHED, strip_widths

COUNT = 450


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("upr", [0, 15])  # fewer samples than sectors are kept behind a filter
def test_each_sector_has_the_extremes_of_its_samples_less_the_first_lines(sense, upr, rng) -> None:
    theta_deg = np.mod(40.0 + sense * np.sort(rng.uniform(0.0, 360.0, COUNT)), 360.0)
    lines = np.arange(COUNT // 2 + 1)
    passed = np.exp(-((lines / upr) ** 2)) if upr else np.ones(len(lines))
    apart = form_and_noise(rng.standard_normal(COUNT))
    found = drawn_paths(apart, theta_deg, passed, 7, (2, 0))
    same = np.random.default_rng([SEED, 7])
    spectra = np.vstack([drawn_lines(apart, passed, DRAWS // BLOCKS, same) for _ in range(BLOCKS)])
    for path, taken in zip(found, (2, 0), strict=True):
        noise = np.fft.irfft(np.where(lines < taken, 0.0, spectra), COUNT, axis=1)
        edges = [*path.starts, len(path.order)]
        for sector, (begin, end) in enumerate(pairwise(edges)):
            samples = noise[:, path.order[begin:end]]
            assert path.highest_um[:, sector] == pytest.approx(samples.max(axis=1), abs=1e-12)
            assert path.lowest_um[:, sector] == pytest.approx(samples.min(axis=1), abs=1e-12)


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
