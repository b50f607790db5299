from __future__ import annotations

import numpy as np
import pytest

from dbbstation.instrument.stamps import StreamStamps


def test_late_wake_ups_do_not_move_the_samples() -> None:
    rng = np.random.default_rng(4)
    true_s = 5.0 + 0.004 * np.arange(5000)
    # An adapter that hands its bytes over every 16 ms, and a reader that is now and then 50 ms late.
    seen_s = np.ceil(true_s / 0.016) * 0.016 + rng.uniform(0.0, 0.001, 5000) + 0.05 * (rng.uniform(size=5000) < 0.02)
    seen_s = np.maximum.accumulate(seen_s)
    stamps = StreamStamps(0.004)
    error_s = np.array([stamps.stamp(float(seen)) for seen in seen_s]) - true_s
    assert np.std(seen_s - true_s) > 0.005
    assert np.std(error_s[250:]) < 0.0005


def test_a_lost_sample_takes_its_time() -> None:
    stamps = StreamStamps(0.01)
    assert stamps.stamp(1.0) == pytest.approx(1.0)
    assert stamps.stamp(1.5, lost=3) == pytest.approx(1.04)


@pytest.mark.parametrize("rate", [0.97, 1.03])
def test_a_device_with_a_wrong_rate_is_followed(rate: float) -> None:
    stamps = StreamStamps(0.01)
    error_s = [stamps.stamp(1.0 + 0.01 * rate * n) - (1.0 + 0.01 * rate * n) for n in range(3000)]
    assert abs(error_s[-1]) < 0.07
    assert abs(error_s[-1] - error_s[-1000]) < 1e-4


def test_time_never_stands_still() -> None:
    stamps = StreamStamps(0.01)
    times_s = [stamps.stamp(1.0) for _ in range(10)]
    assert all(np.diff(times_s) > 0.0)
