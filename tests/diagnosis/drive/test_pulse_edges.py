"""Whether stretches of time are a push from elsewhere, or a law that is wrong where the drive turns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from dbbstation.diagnosis.drive.pulses import Edges
from dbbstation.diagnosis.drive.signals import signals_of
from dbbstation.trace.drive import DriveRecording
from tests.diagnosis.drive.plant import Truth, record, to_and_fro


@pytest.mark.parametrize(("count", "at_turns", "share"), [(2, 0, 0.25), (8, 4, 0.047), (50, 12, 0.24), (6, 6, 0.05)])
def test_the_probability_is_that_of_two_binomials(count, at_turns, share):
    def likelihood(q):
        return q**at_turns * (1.0 - q) ** (count - at_turns)

    more_often = quad(likelihood, share, 1.0, epsabs=0.0, epsrel=1e-9)[0] / (1.0 - share)
    expected = 0.95 * likelihood(share) / (0.95 * likelihood(share) + 0.05 * more_often)
    assert Edges(count, at_turns, share).pushed == pytest.approx(expected, rel=1e-6)


def test_one_push_on_the_way_is_a_push_and_what_only_turns_show_is_none():
    assert Edges(2, 0, 0.25).pushed > 0.95
    assert Edges(2, 2, 0.05).pushed < 0.5
    assert Edges(8, 4, 0.047).pushed < 0.1


def test_turns_are_starts_stops_and_reversals_and_no_push_on_the_way():
    """Strokes at 0.1 m/s with 1 m/s²: a tenth of a second before and behind each reversal; 60 N push at 5 s, far from one."""
    truth = Truth(coulomb=20.0, load=lambda t, _x, _v: 60.0 * (5.0 <= t < 5.2))
    columns = record(truth, to_and_fro((0.1,), 0.2, 1.0, 12.0), force_noise=0.1)
    signals = signals_of(DriveRecording("strokes", *columns))
    position, seconds = columns[1], signals.t_s
    highest = int(np.argmax(position[:3000]))
    assert signals.turns[highest - 50 : highest + 50].all()
    assert not signals.turns[(seconds > 4.7) & (seconds < 5.4)].any()
    assert 0.05 < signals.turns.mean() < 0.25
