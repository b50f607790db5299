"""The noise of turns against the noise that was put in, with form that a model lacks and with columns that a fit took out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.inference.harmonics import misfit, noise_of_turns

TURNS, LEVEL = 40, 0.5


def turns(rng, samples, correlation):
    """First-order process in every turn, of standard deviation `LEVEL`."""
    pushes = LEVEL * np.sqrt(1.0 - correlation**2) * rng.standard_normal((TURNS, samples + 300))
    return list(lfilter([1.0], [1.0, -correlation], pushes, axis=1)[:, 300:])


def low_harmonics(samples, highest):
    angle = np.linspace(0.0, 2.0 * np.pi, samples, endpoint=False)
    waves = (wave(k * angle) for k in range(1, highest + 1) for wave in (np.cos, np.sin))
    return np.column_stack([np.ones(samples), *waves])


@pytest.mark.parametrize("samples", [113, 360, 1500])
@pytest.mark.parametrize("correlation", [0.0, 0.6])
@pytest.mark.parametrize("taken_out", [0, 3])
def test_smooth_figures_feel_the_noise_that_was_put_in(rng, samples, correlation, taken_out):
    """Slow noise of a first-order process is (1 + r) / (1 - r) times its variance; what a fit takes out changes nothing."""
    left, used = turns(rng, samples, correlation), 0.0
    if taken_out:
        columns = low_harmonics(samples, taken_out)
        left = [one - columns @ np.linalg.lstsq(columns, one, rcond=None)[0] for one in left]
        used = float(TURNS * columns.shape[1])
    found = noise_of_turns(left, used)
    assert found.sigma == pytest.approx(LEVEL, rel=0.05)
    assert found.effective == pytest.approx(LEVEL * np.sqrt((1.0 + correlation) / (1.0 - correlation)), rel=0.15)


@pytest.mark.parametrize("samples", [113, 1500])
def test_form_that_a_model_lacks_is_no_correlation(rng, samples):
    form = 3.0 * np.cos(np.linspace(0.0, 6.0 * np.pi, samples, endpoint=False))
    found = noise_of_turns([one + form for one in turns(rng, samples, 0.0)], 0.0)
    assert found.sigma == pytest.approx(np.sqrt(LEVEL**2 + 4.5), rel=0.05)
    assert found.correlation_samples == pytest.approx(1.0, abs=0.02)


def test_few_samples_and_none_left_are_white(rng):
    assert noise_of_turns(turns(rng, 30, 0.6), 0.0).correlation_samples == 1.0
    found = noise_of_turns([np.zeros(100)], 0.0)
    assert (found.sigma, found.correlation_samples) == (0.0, 1.0)


@pytest.mark.parametrize("harmonic", range(2, 31))
def test_a_wave_that_a_model_reaches_is_never_noise(rng, harmonic):
    """Four times the noise, the same in all turns: the noise is read above harmonic 30, and the wave is beyond it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    left = [one + 4.0 * LEVEL * np.sqrt(2.0) * np.cos(harmonic * angle + 0.3) for one in turns(rng, 720, 0.0)]
    found = misfit(left, [angle] * TURNS, range(TURNS), 0.0)
    assert found.noise == pytest.approx(LEVEL, rel=0.1)
    assert found.probability < 1e-9
    assert found.rms == pytest.approx(4.0 * LEVEL, rel=0.05)
