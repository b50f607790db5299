"""Tails of a circle's noise: weighed by likelihoods that SciPy has too, and drawn with unit variance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import gennorm, kurtosis, t

from dbbstation.circles.form import form_and_noise
from dbbstation.circles.pushes import EXPONENTS, NO_TAILS, Pushes, pushes_of
from dbbstation.inference.coloured import TAILS

COUNT = 720


def alone(number):
    weights = np.zeros(len(NO_TAILS.weights))
    weights[number] = 1.0
    return Pushes(weights)


def weights_of(values):
    return pushes_of(np.fft.rfft(values), len(values)).weights


@pytest.mark.parametrize("number", range(2, 1 + len(TAILS) + len(EXPONENTS)))
def test_each_is_drawn_with_unit_variance(number):
    """2.5 degrees of freedom have a variance that no sample settles on, and are left out."""
    drawn = alone(number).drawn(np.random.default_rng(1), 40, 5000)
    assert drawn.var() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("exponent", "excess"), [(b, gennorm(b).stats("k")) for b in EXPONENTS])
def test_tails_of_an_exponent_have_its_kurtosis(exponent, excess):
    drawn = alone(1 + len(TAILS) + EXPONENTS.index(exponent)).drawn(np.random.default_rng(2), 40, 5000)
    assert kurtosis(drawn.ravel()) == pytest.approx(float(excess), rel=0.1)


def test_weights_are_those_of_the_likelihoods(rng):
    values = rng.laplace(size=COUNT)
    weights = np.log(weights_of(values))
    first = 1 + len(TAILS)

    def exponential(b):
        return gennorm.logpdf(values, *gennorm.fit(values, fbeta=b, floc=0.0)).sum()

    def student(freedom):
        return t.logpdf(values, *t.fit(values, fdf=freedom, floc=0.0)).sum()

    assert weights[first] - weights[first + 1] == pytest.approx(exponential(1.0) - exponential(1.25), abs=1e-3)
    assert weights[3] - weights[4] == pytest.approx(student(TAILS[2]) - student(TAILS[3]), abs=0.02)
    assert weights[first] - weights[3] == pytest.approx(exponential(1.0) - student(TAILS[2]), abs=0.02)


def test_noise_is_told_by_its_tails(rng):
    assert np.mean([weights_of(rng.standard_normal(COUNT))[0] for _ in range(40)]) > 0.9
    assert weights_of(rng.standard_t(3.0, COUNT))[1 : 1 + len(TAILS)].sum() > 0.9
    assert pushes_of(np.fft.rfft(rng.uniform(-1.0, 1.0, COUNT)), COUNT).excess < -0.8


def test_one_reading_that_is_off_is_no_short_form(rng):
    """A spike that four readings show is; each is 12 standard deviations high."""
    quiet = rng.standard_normal(COUNT)
    alone_off, wide = quiet.copy(), quiet.copy()
    alone_off[200] += 12.0
    wide[200:204] += 12.0
    assert np.ptp(form_and_noise(alone_off).form_um) < 6.0
    assert np.ptp(form_and_noise(wide).form_um) > 6.0
