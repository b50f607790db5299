"""Stated sizes of mountings held against the data: right in 95 of 100 where they are right, and found out where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.checks.scatter import check_scatter, seats_of
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.shipped import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session

SESSIONS = 40


@pytest.fixture(scope="module")
def machine():
    return read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")


def sessions(machine, stated):
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    truth = MachineModel(machine, random_kinematics(machine, 5))
    for seed in range(SESSIONS):
        runs = draw_session(truth, plan, np.random.default_rng(seed), 0.0005, 48)
        said = [
            replace(
                o,
                setup=replace(
                    o.setup,
                    mounting_repeatability_mm=stated * o.setup.mounting_repeatability_mm,
                    ball_uncertainty_mm=stated * o.setup.ball_uncertainty_mm,
                ),
            )
            for o in runs
        ]
        yield calibrate(machine, said)


@pytest.fixture(scope="module")
def as_stated(machine):
    return [seats_of(calibration) for calibration in sessions(machine, 1.0)]


@pytest.mark.slow
def test_sizes_that_are_right_are_said_to_fit(as_stated):
    checks = [check_scatter(seats) for seats in as_stated]
    assert {len(check) for check in checks} == {2}
    fits = [check.fits for both in checks for check in both]
    # 95 of 100, so that fewer than 68 of 80 have a chance of 1 in 1000.
    assert sum(fits) >= 68
    for holder, stated_um in enumerate((np.hypot(0.58, 0.8), np.hypot(1.85, 0.8))):
        assert checks[0][holder].stated_um == pytest.approx(stated_um, abs=1e-3)
        found = np.sqrt(np.mean([both[holder].found_um ** 2 for both in checks]))
        assert found == pytest.approx(stated_um, rel=0.1)


@pytest.mark.slow
def test_sizes_that_are_a_third_of_the_truth_are_found_out(machine):
    checks = [check_scatter(seats_of(calibration)) for calibration in sessions(machine, 1.0 / 3.0)]
    few, many = zip(*checks, strict=True)
    assert sum(not check.fits for check in few) > 0.6 * SESSIONS
    assert all(check.fits is False and check.interval_um[0] > check.stated_um for check in many)


@pytest.mark.slow
def test_the_squares_of_seats_are_chi_square(as_stated):
    seats = [seat for session in as_stated for seat in session]
    freedom = sum(seat.freedom for seat in seats)
    assert freedom > 0.7 * 2 * len(seats)  # a level bar sees two coordinates of every ball, and the fit takes some
    total = sum(seat.square for seat in seats)
    assert abs(total - freedom) < 4.0 * np.sqrt(2.0 * freedom)
