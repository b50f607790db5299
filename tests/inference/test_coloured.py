"""Noise of any colour, with a variance that grows, with long tails: found again where it was made by a closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import norm, t

from dbbstation.inference.coloured import (
    FEWEST_INDEPENDENT,
    Coloured,
    autoregressive,
    bands_of,
    first_order,
    largest_decay,
    log_student,
    most_probable_tails,
    most_probable_variance,
    widening_of,
    with_put_back,
)

RADIUS, TURN = 0.9, 2.0 * np.pi / 12.0
RESONANT = np.array([1.0, -2.0 * RADIUS * np.cos(TURN), RADIUS**2])
"""Taps of a second-order process; its first partial autocorrelation is a1 / (1 + a2), its second a2, both with the other sign."""


def made(rng, rows=4000):
    return lfilter([1.0], RESONANT, rng.standard_normal(rows + 500))[500:]


def test_a_resonant_process_is_found_with_its_order_and_spectrum(rng):
    found = autoregressive(made(rng), [slice(0, 4000)])
    expected = (-RESONANT[1] / (1.0 + RESONANT[2]), -RESONANT[2])
    assert found.partial[:2] == pytest.approx(expected, abs=0.03)
    assert found.order <= 6
    assert found.innovation == pytest.approx(1.0, rel=0.05)
    frequency = np.linspace(0.02, 0.48, 24)
    gain = np.abs(np.exp(-2j * np.pi * np.outer(frequency, np.arange(3))) @ RESONANT) ** 2
    assert found.log_power(frequency) == pytest.approx(-np.log(gain), abs=0.4)


def test_stretches_are_not_taken_for_neighbours(rng):
    rows = made(rng)
    order = np.concatenate([rows[2000:], rows[:2000]])
    halves = autoregressive(order, [slice(0, 2000), slice(2000, 4000)])
    assert halves.partial[:2] == pytest.approx(autoregressive(rows, [slice(0, 4000)]).partial[:2], abs=0.01)


def test_white_noise_is_mostly_found_white(rng):
    orders = [autoregressive(rng.standard_normal(400), [slice(0, 400)]).order for _ in range(60)]
    assert np.mean(np.array(orders) == 0) > 0.5
    assert max(orders) < 12


def test_unwhitening_undoes_whitening(rng):
    noise = Coloured(2.0, (0.7, -0.5, 0.2))
    stretches = [slice(0, 2), slice(2, 3), slice(3, 90)]
    white = rng.standard_normal(90)
    whitening = noise.whitening(stretches)
    assert whitening is not None
    assert whitening @ noise.unwhitened(white, stretches) == pytest.approx(white, abs=1e-12)


def test_a_first_order_process_has_the_effective_samples_of_its_sum():
    noise = Coloured.first_order(2.0, share=0.8, decay=0.9)
    assert noise.correlation_samples == pytest.approx(1.0 + 2.0 * 0.8 * 0.9 / (1.0 - 0.9), rel=0.01)


def test_what_columns_took_is_put_back_where_they_took_it(rng):
    noise = autoregressive(made(rng), [slice(0, 4000)])
    bands = np.array([0.0, 0.05, 0.1, 0.5])
    whole = with_put_back(noise, bands, np.log([0.25, 0.25, 1.0, 1.0]), 4000)
    at = np.array([0.02, 0.25, 0.4])
    assert whole.log_power(at) - noise.log_power(at) == pytest.approx([np.log(4.0), 0.0, 0.0], abs=0.2)


@pytest.mark.parametrize("degrees", [3.0, 6.0])
def test_long_tails_are_found_with_their_degrees_of_freedom(rng, degrees):
    new = 1.7 * rng.standard_t(degrees, 6000)
    trust, tails = most_probable_tails(new)
    assert tails == degrees
    # A row that is as far out as its scale has the weight one; one far out hardly any.
    assert trust[np.abs(new).argmin()] == pytest.approx(np.sqrt((degrees + 1.0) / degrees), rel=1e-3)
    assert trust[np.abs(new).argmax()] < 0.4


def test_the_density_of_long_tails_is_that_of_students_t():
    at = np.linspace(-9.0, 9.0, 37)
    assert log_student(at, 4.0) - log_student(at[:1], 4.0) == pytest.approx(t.logpdf(at, 4.0) - t.logpdf(at[0], 4.0))
    assert log_student(at, 4.0) == pytest.approx(t.logpdf(at, 4.0) - norm.logpdf(0.0), abs=1e-12)


def test_a_variance_that_grows_is_found_with_its_size(rng):
    speed = np.abs(np.sin(np.linspace(0.0, 40.0, 3000)))
    powers = np.square(rng.standard_normal(3000) * np.hypot(0.5, speed))
    cost, variance = most_probable_variance(powers, np.ones(3000), np.square(speed)[:, None], 0.0)
    assert cost < most_probable_variance(powers, np.ones(3000), np.zeros((3000, 0)), 0.0)[0]
    assert np.corrcoef(variance, 0.25 + speed**2)[0, 1] > 0.999
    # Parts that grow are tried in steps of two.
    ratio = (0.25 + speed.max() ** 2) / (0.25 + speed.min() ** 2)
    assert 0.5 * ratio < variance.max() / variance.min() < 2.0 * ratio


def test_short_runs_have_a_spectrum_too():
    """Forty runs of 50 rows of a first-order process of 0.8, which counts as one row in (1 + 0.8) / (1 - 0.8) = 9."""
    rng = np.random.default_rng(7)
    runs = []
    for _ in range(40):
        values = [rng.standard_normal()]
        for new in rng.standard_normal(49):
            values.append(0.8 * values[-1] + 0.6 * new)
        runs.append(values)
    rows, stretches = np.concatenate(runs), [slice(50 * k, 50 * k + 50) for k in range(40)]
    bands = bands_of(rows, stretches)
    assert bands is not None
    # Correlations are tried in steps of a tenth: 0.7 counts as one in 5.7, 0.9 as one in 19.
    assert first_order(bands).correlation_samples == pytest.approx(9.0, rel=1.0 / 3.0)
    assert bands_of(rows[:150], [slice(15 * k, 15 * k + 15) for k in range(10)]) is None


def one(rows):
    return [slice(0, rows)]


def test_white_noise_has_as_many_independent_samples_as_rows():
    assert Coloured(2.0).independent_samples(one(600)) == pytest.approx(600.0)
    assert Coloured(2.0).independent_samples([slice(0, 250), slice(250, 600)]) == pytest.approx(600.0)


@pytest.mark.parametrize("rows", [100, 600, 3001])
@pytest.mark.parametrize(
    ("share", "decay", "turn"), [(1.0, 0.5, 0.0), (1.0, 0.9, 0.0), (0.7, 0.95, 0.0), (1.0, 0.9, 0.6)]
)
def test_independent_samples_are_those_of_the_autocorrelation(rows, share, decay, turn):
    """n / (1 + 2 sum of rho(k)²) with rho(k) = share decay^k cos(k turn); of a first-order process n (1 - r²) / (1 + r²)."""
    lags = np.arange(1, 2000)
    correlation = share * decay**lags * np.cos(turn * lags)
    expected = rows / (1.0 + 2.0 * np.sum(correlation**2))
    noise = Coloured.first_order(3.0, share, decay, turn)
    # Of few rows the spectrum is coarse.
    assert noise.independent_samples(one(rows)) == pytest.approx(expected, rel=0.01 if rows > 500 else 0.05)
    if share == 1.0 and not turn:
        assert expected == pytest.approx(rows * (1.0 - decay**2) / (1.0 + decay**2))


def test_runs_apart_have_the_independent_samples_of_each():
    noise = Coloured.first_order(1.0, 1.0, 0.995)
    alone = noise.independent_samples(one(40))
    assert 1.0 < alone < 3.0
    assert noise.independent_samples([slice(40 * k, 40 * k + 40) for k in range(10)]) == pytest.approx(10.0 * alone)


def test_a_narrow_line_has_few_independent_samples():
    """Almost a wave: its phase is its own for a thousand rows, and 500 rows are one sample of it."""
    narrow = Coloured.first_order(1.0, 1.0, 0.999, 0.8)
    assert narrow.independent_samples(one(500)) < FEWEST_INDEPENDENT / 4.0


@pytest.mark.parametrize("rows", [40, 100, 1000, 3000])
def test_noise_as_slow_as_it_may_be_has_as_many_independent_samples_as_it_must(rows):
    slowest = Coloured.first_order(1.0, 1.0, largest_decay(rows))
    assert slowest.independent_samples(one(rows)) == pytest.approx(FEWEST_INDEPENDENT, rel=0.01)


def test_few_rows_are_white():
    assert largest_decay(20) == largest_decay(5) == 0.0


def test_a_bounded_process_that_oscillates_is_found_with_its_phase(rng):
    """Real part of z(k) = r exp(i t) z(k - 1) + e(k), whose autocorrelation is r^k cos(k t), with white noise on top."""
    decay, turn = 0.93, 0.9
    pushes = rng.standard_normal((2, 4500))
    rows = lfilter([1.0], [1.0, -decay * np.exp(1j * turn)], pushes[0] + 1j * pushes[1])[500:].real
    rows = rows / np.std(rows) + rng.standard_normal(4000)
    bands = bands_of(rows, one(4000))
    found = first_order(bands, 0.95, oscillates=True)
    frequency = np.linspace(0.02, 0.48, 24)
    apart = 2.0 * np.pi * frequency - np.array([[turn], [-turn]])
    power = 1.0 + np.mean((1.0 - decay**2) / (1.0 + decay**2 - 2.0 * decay * np.cos(apart)), axis=0)
    assert found.parameters == 3
    assert found.log_power(frequency) == pytest.approx(np.log(power), abs=0.6)
    flat = first_order(bands, 0.95)
    assert np.abs(flat.log_power(frequency) - np.log(power)).max() > 1.0


@pytest.mark.parametrize("degrees", [2.5, 4.0, 10.0])
def test_estimates_in_long_tails_are_as_uncertain_as_fishers_information(degrees):
    """By quadrature over Student's t; fixed weights have on average the information of one standard normal row."""
    per_row = t(degrees).expect(lambda x: ((degrees + 1.0) * x / (degrees + x**2)) ** 2)
    assert widening_of(degrees) == pytest.approx(1.0 / per_row, rel=1e-6)
    assert widening_of(np.inf) == 1.0
