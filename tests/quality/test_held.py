"""A length that stands still is recognised within two seconds, and sound readings are not taken for one."""

from __future__ import annotations

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.quality.finding import FindingVerdict
from dbbstation.quality.held import HeldLength, equal_limit, held
from dbbstation.quality.limits import SHARE

TURN_S = 54.0


def readings(seed, rate_hz=50.0, white_um=0.4, correlated_um=0.4, corner_s=0.1, step_um=0.1, form_um=20.0):
    """A turn: an ellipse and a triangle, white noise and noise that remembers, read in steps [s, mm]."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, TURN_S, 1.0 / rate_hz)
    phi = 2.0 * np.pi * t_s / TURN_S
    memory = np.exp(-1.0 / (rate_hz * corner_s))
    drawn = rng.normal(0.0, correlated_um * np.sqrt(1.0 - memory**2), len(t_s))
    slow = np.empty_like(drawn)
    slow[0] = drawn[0]
    for k in range(1, len(drawn)):
        slow[k] = memory * slow[k - 1] + drawn[k]
    um = form_um * (np.cos(2.0 * phi) + 0.3 * np.sin(3.0 * phi)) + rng.normal(0.0, white_um, len(t_s)) + slow
    return t_s, 150.0 + 1e-3 * step_um * np.round(um / step_um)


def recognised_s(t_s, length_mm):
    """Time at which the length is seen to stand still; None where it never is."""
    watch = HeldLength()
    for t, length in zip(t_s.tolist(), length_mm.tolist(), strict=True):
        watch.add(t, length)
        if watch.stands(len(t_s)):
            return t
    return None


def stuck(t_s, length_mm, at_s):
    place = np.searchsorted(t_s, at_s)
    return np.where(t_s < at_s, length_mm, length_mm[place])


def clipped(length_mm, share):
    """Readings that do not go beyond what is left of the gauge's stroke."""
    return np.minimum(length_mm, np.quantile(length_mm, share))


@pytest.mark.parametrize("rate_hz", [10.0, 50.0, 1000.0])
@pytest.mark.parametrize("at_s", [8.0, 30.0])
def test_a_stuck_length_is_recognised_within_two_seconds(rate_hz, at_s):
    t_s, length_mm = readings(1, rate_hz)
    seen_s = recognised_s(t_s, stuck(t_s, length_mm, at_s))
    assert seen_s is not None
    assert 0.9 <= seen_s - at_s <= 2.0


def test_a_clipped_length_is_recognised_within_two_seconds():
    t_s, length_mm = readings(2, form_um=-20.0)
    whole = clipped(length_mm, 0.6)
    seen_s = recognised_s(t_s, whole)
    # It goes beyond for good where the form is three sigmas above the stop.
    form = -20.0 * (np.cos(4.0 * np.pi * t_s / TURN_S) + 0.3 * np.sin(6.0 * np.pi * t_s / TURN_S))
    beyond = t_s[(form > 1e3 * (whole.max() - 150.0) + 3.0 * 0.57)][0]
    assert seen_s is not None
    assert seen_s - beyond <= 2.0


def test_what_runs_before_showed_of_the_noise_is_known_to_the_next():
    t_s, length_mm = readings(2)
    watch = HeldLength()
    for t, length in zip(t_s.tolist(), length_mm.tolist(), strict=True):
        watch.add(t, length)
    watch.restart()
    assert watch.held_s == 0.0
    for t in np.arange(0.0, 2.0, 0.02).tolist():
        watch.add(t, 150.01)
    assert watch.stands(len(t_s))


@pytest.mark.parametrize("step_um", [2.0, 10.0])
def test_a_step_that_is_not_finer_than_the_noise_says_nothing(step_um):
    t_s, length_mm = readings(3, white_um=0.2, step_um=step_um)
    assert recognised_s(t_s, stuck(t_s, length_mm, 20.0)) is None


def test_readings_without_noise_that_hardly_move_are_not_stuck():
    t_s = np.arange(0.0, TURN_S, 0.02)
    assert recognised_s(t_s, np.round(150.0 + 1e-6 * np.cos(2.0 * np.pi * t_s / TURN_S), 6)) is None
    assert recognised_s(t_s, 150.0 + 1e-14 * np.random.default_rng(1).integers(0, 2, len(t_s))) is None


def test_a_display_that_is_asked_more_often_than_it_is_renewed_is_not_stuck():
    t_s, length_mm = readings(4, rate_hz=50.0)
    assert recognised_s(t_s, length_mm[(np.arange(len(t_s)) // 25) * 25]) is None


def test_false_alarms_of_a_thousand_sound_turns():
    """SHARE is stated: of a thousand turns none is to be expected, and one has a probability of a tenth of a percent a finding."""
    alarms = 0
    rng = np.random.default_rng(34)
    for turn in range(1000):
        rate_hz, step_um = rng.choice([5.0, 10.0]), float(rng.choice([0.1, 0.5, 1.0]))
        white_um, corner_s = float(rng.uniform(0.1, 1.0)), float(rng.uniform(0.05, 1.0))
        t_s, length_mm = readings([34, turn], rate_hz, white_um, step_um=step_um, corner_s=corner_s)
        alarms += recognised_s(t_s, length_mm) is not None
    assert alarms == 0


def test_the_limit_by_hand():
    """White noise of one step: each reading is any given value with 1 / sqrt(2 pi) at the most; rounding adds a twelfth."""
    step, count = 1e-4, 10**9
    squares = 6.0 * (1.0 + 1.0 / 12.0) * step**2 * count
    n = equal_limit(squares, count, step, 1000.0)
    probability = 1000.0 * (1.0 / np.sqrt(2.0 * np.pi)) ** (n - 1.0)
    assert probability <= SHARE * 1.01
    assert probability * np.sqrt(2.0 * np.pi) > SHARE
    assert equal_limit(squares, count, 3.0 * step, 1000.0) == inf


class Turn(SimpleNamespace):
    """As much of a raw circle as the finding reads."""

    def __len__(self):
        return len(self.t_s)


def test_a_recorded_turn_that_stood_still_has_that_as_its_finding():
    t_s, length_mm = readings(5)
    theta_deg = 360.0 * t_s / TURN_S
    assert held(Turn(t_s=t_s, length_mm=length_mm, theta_deg=theta_deg)).verdict is FindingVerdict.GOOD
    gone = length_mm.copy()
    gone[1000:1100] = gone[1000]
    found = held(Turn(t_s=t_s, length_mm=gone, theta_deg=theta_deg))
    assert found.verdict is FindingVerdict.WRONG
    assert found.value == pytest.approx(99 * 0.02, abs=0.021)
    assert f"{theta_deg[1000]:.0f} degrees" in found.text
    coarse = held(Turn(t_s=t_s, length_mm=np.round(gone, 2), theta_deg=theta_deg))
    assert coarse.verdict is FindingVerdict.CANNOT_TELL
