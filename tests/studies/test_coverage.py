"""The study of stated intervals, small; its whole size is a command whose last figures stand in docs/validation.md."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from studies.coverage import coverage, wilson


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "level", "machines"),
    [
        ("table2-elevated", False, 10),
        pytest.param("table2-elevated", False, 40, marks=pytest.mark.nightly),
        pytest.param("table2", True, 40, marks=pytest.mark.nightly),
    ],
)
def test_intervals_hold_the_truth_as_often_as_they_say(reference, name, level, machines):
    plan = read_plan(shipped_folder("protocols") / "plans" / f"{name}.yaml")
    told = []
    found = coverage(reference, plan, range(1000, 1000 + machines), told.append, level=level)
    assert told == list(range(1, machines + 1))
    numbers = found.numbers()
    assert len(numbers["parameters"]) == 24
    # Parameters of one machine are correlated, so that 40 machines are worth some 200 independent ones: 95 ± 3 %.
    wider = np.sqrt(40 / machines)
    assert numbers["parameters_pooled"] == pytest.approx(0.95, abs=0.03 * wider)
    assert 0.95 - 0.05 * wider < numbers["positions_pooled"] < min(0.95 + 0.04 * wider, 1.0)
    # Neither too long: the errors' own scatter is that stated.
    assert np.sqrt(np.mean(found.parameters**2)) == pytest.approx(1.0, abs=0.12 * wider)


def test_wilsons_interval_as_tabulated():
    """For 9 of 10: 0.596 to 0.982 [Brown, Cai and DasGupta, Statistical Science 16 (2001) 101]."""
    assert wilson(0.9, 10) == pytest.approx((0.596, 0.982), abs=1e-3)
    assert all(wilson(0.0, count)[0] >= 0.0 and wilson(1.0, count)[1] <= 1.0 for count in range(1, 200))
