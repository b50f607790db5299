"""What a model leaves beside known noise: a fine wave, one bad run and a pulse are found where they are."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.inference.bounds import BOUNDS
from dbbstation.inference.harmonics import LOW, Spectrum
from dbbstation.inference.left_over import remainder

RUNS, SAMPLES, LEVEL = 10, 720, 0.4
PHASE = np.linspace(0.0, 2 * np.pi, SAMPLES, endpoint=False)
NOISE = Spectrum(np.full(LOW + 1, LEVEL**2), 2.0 * RUNS * 200)


def of(residuals):
    return remainder(residuals, [PHASE] * RUNS, list(range(RUNS)), NOISE)


def white(rng):
    return list(rng.normal(0.0, LEVEL, (RUNS, SAMPLES)))


def test_of_noise_alone_nothing_stands_out(rng):
    """Of 300 draws no more are below a probability than that share of them; three more by chance [binomial, 3 sigma]."""
    found = [of(white(rng)).probability for _ in range(300)]
    for limit in (0.3, 0.1, 0.03):
        expected = 300 * limit
        assert np.sum(np.array(found) < limit) < expected + 3 * np.sqrt(expected)
    assert min(found) > 1e-5


def test_a_fine_wave_is_found_with_its_size(rng):
    wave = 0.1 * np.cos(23 * PHASE)
    found = of([run + wave for run in white(rng)])
    assert found.harmonic.probability < 1e-8
    assert found.harmonic.place == 23
    assert found.harmonic.rms == pytest.approx(0.1 / np.sqrt(2), abs=3 * LEVEL / np.sqrt(SAMPLES * RUNS))
    assert found.run.probability > 1e-4


def test_one_bad_run_is_found(rng):
    runs = white(rng)
    runs[7] = runs[7] + 0.2 * sum(np.cos(k * PHASE + k * k) for k in range(2, 12))
    found = of(runs)
    assert found.run.probability < 1e-8
    assert found.run.place == 7
    assert found.run.rms == pytest.approx(0.2 * np.sqrt(10 / 2), abs=0.06)


def test_a_pulse_is_found_where_it_is(rng):
    """Of three degrees in one run, eight standard deviations of their mean."""
    runs = white(rng)
    narrow = (np.radians(120.0) <= PHASE) & (np.radians(123.0) > PHASE)
    height = 8.0 * LEVEL / np.sqrt(narrow.sum())
    runs[4] = runs[4] + height * narrow
    found = of(runs)
    assert found.pulse.probability < 1e-6
    assert found.pulse.place == 4
    assert np.degrees(found.pulse_phase_rad) == pytest.approx(121.5, abs=360.0 / BOUNDS.pulses)
    assert found.pulse.rms == pytest.approx(height, abs=4 * LEVEL / np.sqrt(narrow.sum()))


def test_what_runs_of_one_group_share_in_the_first_harmonic_counts_as_nothing(rng):
    shift = 3.0 * np.cos(PHASE)
    together = remainder([run + shift for run in white(rng)], [PHASE] * RUNS, [0] * RUNS, NOISE)
    assert together.harmonic.probability > 1e-5
    assert together.run.probability > 1e-5
