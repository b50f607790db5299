"""Several sessions of one machine in one fit: what they share is one unknown, and what is lost is said."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.checks.visibility import gaps
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.errors import InputError
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import elevated, table_ii_plan
from tests.plant.session import record

ERRORS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The machine of one seed measured on two days: level and with raised bars, on one plate."""
    where = tmp_path_factory.mktemp("days")
    plan = table_ii_plan(6)
    record(where / "monday", seed=6, plan=plan, mechanisms=[ERRORS], rate_hz=10.0)
    # At another rate, so that no run repeats the other day's noise.
    record(where / "tuesday", seed=6, plan=elevated(plan, 5.0, "abcde"), mechanisms=[ERRORS], rate_hz=9.0)
    return where / "monday", where / "tuesday"


def test_two_sessions_see_what_one_does_not_and_know_more(folders):
    monday, both = load_sessions(folders[:1]), load_sessions(folders)
    alone = calibrate(monday.machine, monday.observations)
    together = calibrate(both.machine, both.observations)
    assert (alone.parameters_identified, together.parameters_identified) == (23, 24)
    length = slice(0, 6)
    sigma_alone, sigma = (np.sqrt(np.diag(c.solution.covariance)[length]) for c in (alone, together))
    # Not by a factor of the square root of two: the CMM errors of the plate are the same on both days.
    assert np.all(sigma < sigma_alone)
    assert np.all(sigma > sigma_alone / np.sqrt(2.0))


def test_a_ball_of_one_cmm_sheet_has_one_error_in_both_sessions(folders):
    both = load_sessions(folders)
    balls = {o.setup.ball for o in both.observations}
    assert len(balls) == 15
    assert len({o.setup.mounting for o in both.observations}) == 30
    calibration = calibrate(both.machine, both.observations)
    assert sum(term.source.name == "ball-coordinate" for term in calibration.layout.terms) == 15
    assert sum(term.source.name == "bar-offset" for term in calibration.layout.terms) >= 1


def test_another_cmm_sheet_is_another_error(folders, tmp_path):
    other = tmp_path / "wednesday"
    record(other, seed=7, plan=table_ii_plan(7), mechanisms=[ERRORS], rate_hz=10.0)
    both = load_sessions([folders[0], other])
    assert len({o.setup.ball for o in both.observations}) == 30


def test_sessions_of_machines_with_different_serial_numbers_are_refused(folders, tmp_path):
    other = tmp_path / "other"
    record(other, seed=6, plan=table_ii_plan(6), mechanisms=[ERRORS], rate_hz=10.0)
    for folder, number in ((folders[0], "PM600-0001"), (other, "PM600-0002")):
        text = re.sub(r"^serial_number:.*\n", "", (folder / "session.yaml").read_text(), flags=re.MULTILINE)
        (folder / "session.yaml").write_text(f"serial_number: {number}\n{text}")
    with pytest.raises(InputError, match=r"of machine PM600-0002, .* of machine PM600-0001"):
        load_sessions([folders[0], other])


def test_one_level_loses_three_directions_and_is_told_why(folders):
    monday = load_sessions(folders[:1])
    level = [o for o in monday.observations if o.test in "abcde"]
    calibration = calibrate(monday.machine, level)
    assert len(calibration.directions_lost) == 3  # rank 21 of 24
    told = gaps(calibration)
    assert "one height" in told[0]
    assert "raised bar" in told[-1]


def test_one_orientation_is_told_too(folders):
    monday = load_sessions(folders[:1])
    upright = [o for o in monday.observations if o.test in "afk"]
    calibration = calibrate(monday.machine, upright)
    assert calibration.parameters_identified < 21
    assert any("one orientation" in text for text in gaps(calibration))


def test_nothing_is_told_where_nothing_is_lost(folders):
    tuesday = load_sessions(folders[1:])
    assert gaps(calibrate(tuesday.machine, tuesday.observations)) == ()
    tolerant = replace(tuesday.machine, joint_tolerance_mm=0.1)
    assert gaps(calibrate(tolerant, tuesday.observations)) == ()
