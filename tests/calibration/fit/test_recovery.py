"""Errors drawn by an independent simulation are found again, within the stated uncertainty."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.layout import lay_out
from dbbstation.errors import CalibrationError
from dbbstation.model.compensation import compensated
from dbbstation.sources.contract import Motion
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from dbbstation.trace.analysis import centred
from tests.plant.machine import random_machine, reference_machine
from tests.plant.mechanisms.kinematics import Kinematics, RandomKinematics
from tests.plant.noise import Noise
from tests.plant.plan import elevated, subset, table_ii_plan
from tests.plant.session import record

ERRORS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)


@pytest.fixture(scope="module", params=["Rx(A) Ry(B) Rz(C)", "Rz(C) Ry(B) Rx(A)"])
def raised(request, tmp_path_factory):
    """Fifteen circles, five of them raised so that all 24 parameters show, on a machine of either convention."""
    folder = tmp_path_factory.mktemp("plant") / "raised"
    machine = replace(random_machine(4, rotation=request.param), reference_length_error_mm=np.linspace(-0.04, 0.06, 6))
    truth = record(folder, seed=4, machine=machine, plan=elevated(table_ii_plan(4), 5.0, "abcde"), mechanisms=[ERRORS])
    recorded = load_sessions([folder])
    return truth, recorded, calibrate(recorded.machine, recorded.observations)


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    """Level circles on a machine without a common height error: with one, the height that they do not see would
    still reach the other parameters in second order, by tenths of a µm."""
    folder = tmp_path_factory.mktemp("plant") / "level"
    rng = np.random.default_rng(11)
    base = rng.normal(0, 0.1, (6, 3))
    base[:, 2] -= base[:, 2].mean()
    errors = Kinematics(length_mm=rng.normal(0, 0.05, 6), base_mm=base)
    truth = record(folder, seed=11, machine=reference_machine(), mechanisms=[errors])
    recorded = load_sessions([folder])
    return truth, recorded, calibrate(recorded.machine, recorded.observations)


def true_parameters(truth):
    return np.concatenate([truth.delta_length_mm, truth.delta_base_mm.ravel()])


def test_all_24_parameters_within_their_uncertainty(raised):
    truth, _, calibration = raised
    assert calibration.parameters_identified == 24
    assert calibration.directions_lost == ()
    error = calibration.x[:24] - true_parameters(truth)
    covariance = calibration.solution.covariance[:24, :24]
    # The sum of squares in units of the stated covariance is chi-square with 24 degrees of freedom.
    statistic = error @ np.linalg.solve(covariance, error)
    assert chi2.ppf(1e-4, 24) < statistic < chi2.ppf(1 - 1e-4, 24)


def test_what_is_left_is_the_noise_of_the_bar(raised):
    _, _, calibration = raised
    assert 1e3 * calibration.noise.sigma == pytest.approx(0.5, abs=0.02)


def test_predicted_positions_are_the_true_ones(raised, rng):
    truth, _, calibration = raised
    poses = rng.uniform([-150, -150, -1150, -10, -10, 0], [150, 150, -870, 10, 10, 0], (200, 6))
    predicted = calibration.model.of_the_machine().actual_poses(Motion(poses))
    off_um = 1e3 * np.linalg.norm(predicted[:, :3] - truth.actual_pose(poses)[:, :3], axis=1)
    # The machine was wrong by a tenth of a millimetre; the balls are known to one or two µm.
    before_um = 1e3 * np.linalg.norm(poses[:, :3] - truth.actual_pose(poses)[:, :3], axis=1)
    assert before_um.mean() > 50
    assert off_um.max() < 6


def test_compensated_commands_take_the_true_machine_where_it_should_go(raised):
    truth, recorded, calibration = raised
    circle = recorded.observations[0].raw.circle
    wanted = Motion(circle.poses(np.arange(0.0, 360.0, 0.5)), is_path=True)
    commanded = compensated(calibration.model, wanted)
    reached = truth.actual_pose(commanded)
    assert 1e3 * np.linalg.norm(reached[:, :3] - wanted.poses[:, :3], axis=1).max() < 5
    assert np.abs(reached[:, 3:] - wanted.poses[:, 3:]).max() < 1e-3


def test_level_circles_lose_the_height_and_say_so(level):
    truth, _, calibration = level
    assert calibration.parameters_identified == 23
    assert calibration.directions_lost == ("all six base joints together along Z",)
    height = np.zeros(24)
    height[8::3] = 1 / np.sqrt(6)
    assert calibration.x[:24] @ height == pytest.approx(0.0, abs=1e-9)
    # Everything but the height is right within its uncertainty.
    visible = np.eye(24) - np.outer(height, height)
    error = visible @ (calibration.x[:24] - true_parameters(truth))
    covariance = calibration.solution.covariance[:24, :24]
    statistic = error @ np.linalg.pinv(covariance, rcond=1e-9) @ error
    assert chi2.ppf(1e-4, 23) < statistic < chi2.ppf(1 - 1e-4, 23)


def test_without_noise_and_set_up_errors_the_fit_is_exact(tmp_path):
    truth = record(
        tmp_path / "clean",
        seed=2,
        plan=elevated(table_ii_plan(2, scatter_mm=0.02), 5.0, "fghij"),
        mechanisms=[ERRORS],
        setup=[],
        noise=Noise(white_um=0.0),
        angles=True,
        rate_hz=5.0,
    )
    recorded = load_sessions([tmp_path / "clean"])
    calibration = calibrate(recorded.machine, recorded.observations)
    # Recordings are rounded to 0.1 µm; that is all that may be left.
    assert np.abs(calibration.x[:24] - true_parameters(truth)).max() < 1e-3


def test_mountings_and_balls_come_back_as_their_sum(level):
    truth, _, calibration = level
    found = dict(zip(calibration.layout.names, calibration.x, strict=True))
    for mounting, (number, shift_um) in enumerate(truth.mounting_shift_um.items()):
        ball = truth.scene.plan.balls[mounting].name
        true_um = (shift_um + truth.ball_error_um[ball])[:2]
        got_um = np.array(
            [
                1e3
                * sum(
                    v
                    for (source, shared, name), v in found.items()
                    if name == f"{axis}_mm" and f": {ball}" in shared and source in {"mounting", "ball-coordinate"}
                )
                for axis in "xy"
            ]
        )
        assert np.abs(got_um - true_um).max() < 4.0, number


def test_one_height_loses_three_directions(tmp_path):
    record(tmp_path / "low", seed=5, plan=subset(table_ii_plan(5, scatter_mm=0.0), "fghij"), mechanisms=[ERRORS])
    recorded = load_sessions([tmp_path / "low"])
    calibration = calibrate(recorded.machine, recorded.observations)
    assert calibration.parameters_identified <= 21
    assert "all six base joints together along Z" in calibration.directions_lost


def test_one_test_cannot_calibrate(level):
    _, recorded, _ = level
    with pytest.raises(CalibrationError, match="1 test cannot calibrate"):
        calibrate(recorded.machine, recorded.observations[:2])


def test_centred_circles_are_refused(level):
    _, recorded, _ = level
    spoilt = [replace(o, raw=centred(o.raw)) for o in recorded.observations]
    with pytest.raises(CalibrationError, match="centred circle"):
        calibrate(recorded.machine, spoilt)


def test_a_holder_without_scatter_has_no_mounting_to_fit(level):
    _, recorded, _ = level
    exact = [replace(o, setup=replace(o.setup, mounting_repeatability_mm=0.0)) for o in recorded.observations]
    layout = lay_out(recorded.machine, sources_named(["mounting", "ball-coordinate"]), exact)
    assert {term.source.name for term in layout.terms} == {"ball-coordinate"}
