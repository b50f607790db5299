"""Weights of samples: what a low-pass leaves of weighted columns, and how much noise their edges let in."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import savgol_coeffs

from dbbstation.diagnosis.drive.signals import (
    LEAST_SHARE,
    derivatives,
    edge_noise_m_s2,
    half_window,
    impulse_response,
    low_passed,
    rise_of_weights,
    signals_of,
    speed_noise_m_s,
    weights,
    within,
)
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import Truth, record, to_and_fro

RATE_HZ, CUTOFF_HZ = 1000.0, 40.0


def strokes(rest_s=0.2, strokes=8):
    """Position [m] of strokes of half a second along a parabola each, with rests between them, and where it rests."""
    parts, rests, at = [], [], 0.0
    for k in range(strokes):
        u = np.arange(500) / 500.0
        sign = (-1.0) ** k
        parts += [at + sign * 0.03 * (3.0 * u**2 - 2.0 * u**3), np.full(int(rest_s * 1000), at + sign * 0.03)]
        rests += [np.zeros(500, dtype=bool), np.ones(int(rest_s * 1000), dtype=bool)]
        at += sign * 0.03
    return np.concatenate(parts), np.concatenate(rests)


def recorded(force):
    position, _ = strokes()
    return signals_of(DriveRecording("rests", np.arange(len(position)) / RATE_HZ, 1e3 * position, force), CUTOFF_HZ)


def test_whatever_holds_a_drive_at_rest_changes_nothing_that_is_compared(rng):
    """h * (w F) = sum of theta h * (w phi) for every weight: 40 kg, 90 N·s/m, 12 N, and at rest forces up to a hundred times that."""
    position, rests = strokes()
    speed, acceleration = np.gradient(position, 1.0 / RATE_HZ), np.gradient(np.gradient(position)) * RATE_HZ**2
    law = 40.0 * acceleration + 90.0 * speed + 12.0 * np.sign(speed)
    signals = recorded(np.where(rests, rng.uniform(-1200.0, 1200.0, len(position)), law))
    assert (signals.weight[rests] == 0.0).all()
    columns = signals.compared(np.column_stack([acceleration, speed, np.sign(speed)]))
    assert signals.compared(signals.force_n) == pytest.approx(columns @ [40.0, 90.0, 12.0], abs=1e-9)
    # With what holds it let in, the same samples are off by newtons.
    let_in = low_passed(signals.force_n, RATE_HZ, CUTOFF_HZ)[signals.kept]
    bare = low_passed(np.column_stack([acceleration, speed, np.sign(speed)]), RATE_HZ, CUTOFF_HZ)[signals.kept]
    assert np.abs(let_in - bare @ [40.0, 90.0, 12.0]).max() > 5.0


def test_what_is_compared_is_a_mean_over_what_moves(rng):
    """Every sample by hand: the sum of response times weight times column, over the sum of response times weight."""
    position, rests = strokes()
    signals = recorded(rng.normal(0.0, 1.0, len(position)))
    response = impulse_response(RATE_HZ, CUTOFF_HZ)
    reach = len(response) // 2
    found = signals.compared(signals.force_n)
    for row, k in enumerate(signals.kept):
        about = slice(k - reach, k + reach + 1)
        by = response * signals.weight[about]
        assert by.sum() > LEAST_SHARE - 1e-6
        # The response rings on by some ten-thousandths beyond its three periods.
        assert found[row] == pytest.approx(by @ signals.force_n[about] / by.sum(), abs=1e-3)
    assert signals.compared(np.ones(len(position))) == pytest.approx(1.0, abs=1e-12)
    assert not rests[signals.kept].all()


def test_a_sample_weighs_something_only_where_its_speed_was_read_from_a_moving_drive():
    unknown = np.zeros(40, dtype=bool)
    unknown[18:21] = True
    found = weights(within(unknown, 2), 3)
    assert (found[16:23] == 0.0).all()
    assert found[23:27] == pytest.approx(np.sin(np.pi / 8 * np.arange(1, 5)) ** 2)
    assert found[12:16] == pytest.approx(found[26:22:-1])
    assert (found[26:] == 1.0).all()
    assert (weights(np.zeros(5, dtype=bool), 3) == 1.0).all()


@pytest.mark.parametrize("half", [1, 2, 7])
def test_noise_of_a_slope_is_that_of_its_coefficients(half):
    by_coefficients = 3e-7 * float(np.linalg.norm(savgol_coeffs(2 * half + 1, 2, deriv=1, delta=1.0 / RATE_HZ)))
    assert speed_noise_m_s(3e-7, RATE_HZ, half) == pytest.approx(by_coefficients)
    assert half_window(3e-7, RATE_HZ, by_coefficients * 1.001, 50) == half
    assert half_window(3e-7, RATE_HZ, by_coefficients * 1.001, 1) == 1


def test_noise_of_an_edge_is_that_of_many_draws(rng):
    """White noise of 0.3 µm, differenced twice, weighted, low-passed, 400 times over."""
    unknown = np.zeros(400, dtype=bool)
    unknown[190:203] = True
    kept = np.array([100, 180, 186, 203, 209])
    for rise in (0, 6):
        weight = weights(unknown, rise)
        draws = rng.normal(0.0, 3e-7, (402, 400))
        accelerations = np.diff(draws, 2, axis=0) * RATE_HZ**2
        share = low_passed(weight, RATE_HZ, CUTOFF_HZ)[kept]
        seen = low_passed(weight[:, None] * accelerations, RATE_HZ, CUTOFF_HZ)[kept] / share[:, None]
        found = edge_noise_m_s2(weight, kept, 3e-7, RATE_HZ, CUTOFF_HZ)
        assert found[0] == 0.0
        own = 3e-7 * RATE_HZ**2 * float(np.linalg.norm(np.diff(np.pad(impulse_response(RATE_HZ, CUTOFF_HZ), 2), 2)))
        assert seen.std(axis=1) == pytest.approx(np.hypot(found, own), rel=0.12)


def test_weights_rise_as_slowly_as_the_noise_asks_for():
    rises = [rise_of_weights(noise, RATE_HZ, CUTOFF_HZ, 0.01, 40) for noise in (0.0, 1e-8, 1e-7, 1e-6, 1e-5)]
    assert rises[0] == 0
    assert rises == sorted(rises)
    assert 0 < rises[3] < rises[4] <= 40


def test_samples_beside_a_reversal_follow_the_law_without_noise():
    """Friction turns over by 40 N within a reversal; beside it, and across it, what is compared is off by hundredths of a newton."""
    columns = record(
        Truth(coulomb=20.0), to_and_fro(seconds=8.0), force_noise=1e-6, position_noise=0.0, resolution=1e-12
    )
    signals = signals_of(DriveRecording("to and fro", *columns), 50.0)
    speed, acceleration = derivatives(signals.measured_m, signals.rate_hz)
    law = 80.0 * acceleration + 200.0 * speed + 20.0 * signals.direction
    off = signals.compared(signals.force_n - law)
    beside = signals.share < 0.999
    assert beside.sum() > 10
    assert np.abs(off[beside]).max() < 0.02
    assert np.abs(signals.force_n - law).max() > 5.0
