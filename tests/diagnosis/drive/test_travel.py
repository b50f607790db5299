"""Which way a drive travels: turning points of noisy, rounded and jittering positions."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.diagnosis.drive.recordings import EACH_WAY, recordings_of
from dbbstation.diagnosis.drive.sampling import resolution_of, turning_points, ways
from dbbstation.diagnosis.drive.signals import signals_of
from dbbstation.diagnosis.drive.sources import known_drive_sources
from dbbstation.trace.drive import DriveRecording

RATE_HZ = 100.0


def creeping(rng, back=0.0):
    """Stamps [s] and position [mm] of a drive that creeps at 1 mm/s and travels at 40 mm/s in turn, and back at the end.

    What its encoder makes of the position wobbles by 60 um, slowly against the sampling: no white noise shows it.
    """
    t = np.arange(int(20.0 * RATE_HZ)) / RATE_HZ
    speed = np.where(np.mod(t, 4.0) < 2.0, 1.0, 40.0)
    speed = np.where(t > 20.0 - back, -40.0, speed)
    wobble = np.convolve(0.03 * rng.standard_normal(len(t)), 0.5 * np.hanning(9), "same")
    return t, np.cumsum(speed) / RATE_HZ + wobble


def test_turning_points_of_a_triangle_with_a_ripple_that_is_too_small():
    up = np.linspace(0.0, 1.0, 101)
    triangle = np.concatenate([up, up[-2::-1], up[1:]])
    ripple = 0.02 * np.sin(np.arange(len(triangle)))
    assert turning_points(triangle, 0.1).tolist() == [100, 200]
    assert np.abs(turning_points(triangle + ripple, 0.1) - [100, 200]).max() <= 2
    assert len(turning_points(triangle + ripple, 0.005)) > 10
    way = ways(triangle, turning_points(triangle, 0.1))
    assert way[:100].tolist() == [1.0] * 100
    assert way[100:200].tolist() == [-1.0] * 100
    assert way[200:].tolist() == [1.0] * 101


def test_a_drive_that_goes_on_has_no_reversal(rng):
    t, position = creeping(rng)
    signals = signals_of(DriveRecording("creeping", t, position, 10.0 + rng.normal(0.0, 0.1, len(t))))
    # The speed as it is read goes the other way in some samples, by more than what counts as standing.
    assert np.sum(signals.speed_m_s < -signals.standing_m_s) > 10
    assert len(signals.reversals) == 0
    assert not (signals.direction < 0.0).any()


def test_what_differs_by_direction_wants_a_share_of_the_samples_each_way(rng):
    sources = known_drive_sources()
    for back, enough in ((0.6, False), (4.0, True)):
        t, position = creeping(rng, back)
        made = recordings_of([DriveRecording("creeping", t, position, 10.0 + rng.normal(0.0, 0.1, len(t)))])
        assert len(made.signals[0].reversals) >= 1
        assert (made.least_way >= EACH_WAY) is enough
        for name in ("friction-asymmetry", "lost-motion"):
            assert bool(sources[name].forms(made.scale)) is enough


@pytest.mark.parametrize("step", [0.001, 0.02, 0.37])
def test_resolution_of_rounded_positions(rng, step):
    position = step * np.round(np.cumsum(rng.uniform(-3.0, 5.0, 500)))
    assert resolution_of(np.round(position, 9)) == pytest.approx(step, rel=1e-3)
    assert resolution_of(np.cumsum(rng.uniform(-3.0, 5.0, 500))) == 0.0
