"""Noise of a refit, and of any comparison beside members, as of a drive, has 20 independent samples at the least."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from dbbstation.diagnosis.simulator.noise_left import noise_left
from dbbstation.inference.coloured import FEWEST_INDEPENDENT, autoregressive

STEP_S = 0.05


def _refit(blocks):
    """What `noise_left` asks of a simulator's recordings: one output, rounded to a millionth."""
    rows = blocks[-1].stop
    return SimpleNamespace(
        model=SimpleNamespace(
            outputs=[SimpleNamespace(name="y", unit="mm")],
            runs=[SimpleNamespace(name=str(k)) for k in range(len(blocks))],
        ),
        blocks=blocks,
        time=STEP_S * np.arange(rows),
        measured=np.round(np.random.default_rng(1).standard_normal(rows), 6),
        scale=np.ones(rows),
        output=np.zeros(rows, dtype=np.int64),
    )


@pytest.mark.parametrize("runs", [1, 3])
@pytest.mark.parametrize(("decay", "turn"), [(0.995, 0.0), (0.998, 0.3)], ids=["slow", "resonant"])
def test_what_a_refit_leaves_slowly_is_no_noise(rng, runs, decay, turn):
    """A process of (1 + r²) / (1 - r²) rows per independent one, 100 and more of 600, four times the white noise."""
    rows = 600 // runs
    blocks = [slice(k * rows, (k + 1) * rows) for k in range(runs)]
    pushes = rng.standard_normal((2, 600 + 4000))
    slow = lfilter([1.0], [1.0, -decay * np.exp(1j * turn)], pushes[0] + 1j * pushes[1])[4000:].real
    left = 0.4 * slow / np.std(slow) + 0.1 * rng.standard_normal(600)
    # Without the bound it would be noise of few independent samples.
    assert autoregressive(left, blocks).independent_samples(blocks) < FEWEST_INDEPENDENT
    bank = noise_left(_refit(blocks), left, np.ones((600, 1)))
    assert bank.noise.independent_samples(blocks) >= 0.95 * FEWEST_INDEPENDENT


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_noise_of_many_independent_samples_keeps_its_size(rng, share):
    """White, and a first-order process of 0.6, which has 282 independent samples in 600 rows: n (1 - r²) / (1 + r²)."""
    blocks, size = [slice(0, 600)], 0.1
    rows = lfilter([np.sqrt(1.0 - share**2)], [1.0, -share], rng.standard_normal(1600))[1000:]
    bank = noise_left(_refit(blocks), size * rows, np.ones((600, 1)))
    assert bank.noise.sigma == pytest.approx(size, rel=0.2)
    expected = 600 * (1.0 - share**2) / (1.0 + share**2)
    assert bank.noise.independent_samples(blocks) == pytest.approx(expected, rel=0.35)
