"""Stated sizes of mountings held against the data: right in 95 of 100 where they are right, and found out where not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from dbbstation.calibration.checks.scatter import check_scatter, seats_of
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session


@pytest.fixture(scope="module")
def machine():
    return read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")


@pytest.fixture(scope="module", params=[16, pytest.param(40, marks=pytest.mark.nightly)])
def count(request):
    """Number of sessions."""
    return request.param


def sessions(machine, stated, count):
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    truth = MachineModel(machine, random_kinematics(machine, 5))
    for seed in range(count):
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
def as_stated(machine, count):
    return [seats_of(calibration) for calibration in sessions(machine, 1.0, count)]


@pytest.mark.slow
def test_sizes_that_are_right_are_said_to_fit(as_stated, count):
    checks = [check_scatter(seats) for seats in as_stated]
    assert {len(check) for check in checks} == {2}
    fits = [check.fits for both in checks for check in both]
    # 95 of 100; fewer have a chance of 1 in 1000.
    assert sum(fits) >= binom.ppf(1e-3, 2 * count, 0.95)
    for holder, stated_um in enumerate((np.hypot(0.58, 0.8), np.hypot(1.85, 0.8))):
        assert checks[0][holder].stated_um == pytest.approx(stated_um, abs=1e-3)
        found = np.sqrt(np.mean([both[holder].found_um ** 2 for both in checks]))
        # Forty sessions know the size to 5 %, one standard deviation.
        assert found == pytest.approx(stated_um, rel=0.1 * np.sqrt(40 / count))


@pytest.mark.slow
def test_sizes_that_are_a_third_of_the_truth_are_found_out(machine, count):
    """Half as many sessions do: their sizes are far off."""
    checks = [check_scatter(seats_of(calibration)) for calibration in sessions(machine, 1.0 / 3.0, count // 2)]
    few, many = zip(*checks, strict=True)
    assert sum(not check.fits for check in few) > 0.6 * len(checks)
    assert all(check.fits is False and check.interval_um[0] > check.stated_um for check in many)


@pytest.mark.slow
def test_the_squares_of_seats_are_chi_square(as_stated):
    seats = [seat for session in as_stated for seat in session]
    freedom = sum(seat.freedom for seat in seats)
    assert freedom > 0.7 * 2 * len(seats)  # a level bar sees two coordinates of every ball, and the fit takes some
    total = sum(seat.square for seat in seats)
    assert abs(total - freedom) < 4.0 * np.sqrt(2.0 * freedom)
