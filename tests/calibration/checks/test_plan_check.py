"""So few tests that a wrong plan fits as well as the right one are named as such."""

from __future__ import annotations

import re

import pytest

from dbbstation.calibration.checks.scatter import is_missing_physics, misfit_of
from dbbstation.calibration.checks.visibility import check_plan
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.reporting.evaluation import evaluate
from dbbstation.calibration.reporting.figures import calibration_figures
from dbbstation.cli import main
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record


def recorded_under(folder, letters, tilts_written=1.0):
    plan = subset(table_ii_plan(3), letters)
    record(folder, seed=3, plan=plan, mechanisms=[RandomKinematics(0.05, 0.05)], rate_hz=10.0)
    path = folder / "plan.yaml"
    text, count = re.subn(
        r"a_deg: (\S+), b_deg: (\S+),",
        lambda tilt: f"a_deg: {tilts_written * float(tilt[1])}, b_deg: {tilts_written * float(tilt[2])},",
        path.read_text(),
    )
    assert count == len(letters)
    path.write_text(text)
    return load_sessions([folder])


def fitted(folder, letters, tilts_written=1.0):
    recorded = recorded_under(folder, letters, tilts_written)
    return calibrate(recorded.machine, recorded.observations)


@pytest.mark.parametrize(("letters", "enough"), [("agl", False), ("abf", False), ("afkm", True), ("abfgkl", True)])
def test_less_than_one_circle_is_left_of_three_tests(tmp_path, letters, enough):
    calibration = fitted(tmp_path / "s", letters)
    check = check_plan(calibration)
    assert check.tests == len(letters)
    assert check.identified == calibration.parameters_identified
    assert check.enough is enough


def test_half_the_tilts_pass_unseen_at_three_tests_and_that_is_said(tmp_path, capsys):
    """The residual is the noise of the bar, 0.5 µm: nothing but the count tells."""
    recorded = recorded_under(tmp_path / "s", "agl", tilts_written=0.5)
    calibration = calibrate(recorded.machine, recorded.observations)
    assert 1e3 * calibration.noise.sigma == pytest.approx(0.5, abs=0.02)
    assert not is_missing_physics(misfit_of(calibration))
    told = calibration_figures(calibration, evaluate(calibration.model, recorded.observations)).plan_check
    assert told.enough is False
    assert told.left == told.determined - told.identified < told.of_one_test
    with pytest.raises(SystemExit):
        main(["calibrate", str(tmp_path / "s")])
    assert "3 tests are too few to reveal a wrong tilt, height or position in the plan" in capsys.readouterr().out


def test_six_tests_show_half_the_tilts(tmp_path):
    calibration = fitted(tmp_path / "s", "abfgkl", tilts_written=0.5)
    assert is_missing_physics(misfit_of(calibration))
    assert check_plan(calibration).enough
