"""Runs that do not belong are named, and the noise that is reported is the bar's whatever they do."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dbbstation.calibration.fit import calibrate
from dbbstation.calibration.summary import doubtful_runs, fine_noise_mm
from dbbstation.recorded import load_sessions
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("doubt") / "s"
    record(folder, seed=9, mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)], rate_hz=20.0)
    return load_sessions([folder])


def test_good_runs_are_not_doubted(recorded):
    calibration = calibrate(recorded.machine, recorded.observations)
    assert doubtful_runs(calibration) == []
    assert 1e3 * fine_noise_mm(calibration) == pytest.approx(0.5, rel=0.05)


def test_another_circles_samples_are_named(recorded):
    """The readings of test g filed under test a: the fit spreads them over everything, but a stands out."""
    runs = list(recorded.observations)
    of = {(o.test, str(o.raw.circle.direction)): k for k, o in enumerate(runs)}
    wrong, right = runs[of["g", "ccw"]], runs[of["a", "ccw"]]
    count = min(len(wrong.raw), len(right.raw))
    raw = replace(
        right.raw, t_s=right.raw.t_s[:count], phi_deg=right.raw.phi_deg[:count], length_mm=wrong.raw.length_mm[:count]
    )
    runs[of["a", "ccw"]] = replace(right, raw=raw)
    calibration = calibrate(recorded.machine, runs)
    named = doubtful_runs(calibration)
    assert named
    assert named[0]["test"] == "a"
    assert 1e3 * fine_noise_mm(calibration) == pytest.approx(0.5, rel=0.05)


def test_gravity_is_no_reason_to_doubt_a_run(tmp_path):
    record(tmp_path / "s", seed=9, mechanisms=[Gravity()], rate_hz=20.0)
    found = load_sessions([tmp_path / "s"])
    calibration = calibrate(found.machine, found.observations)
    assert doubtful_runs(calibration) == []
    assert 1e3 * fine_noise_mm(calibration) == pytest.approx(0.5, rel=0.05)
