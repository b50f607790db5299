"""Several runs in one file are parted where one ends."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.tasks.importing.splitting import longest_pause_s, parts_by_direction, parts_by_gaps

UP = np.arange(-45.0, 405.0)
DOWN = UP[::-1]


def lengths(parts):
    return [len(part) for part in parts]


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ([UP], [450]),
        ([DOWN], [450]),
        ([UP, DOWN], [450, 450]),
        ([DOWN, UP, DOWN], [450, 450, 450]),
        ([np.mod(UP, 360.0), np.mod(DOWN, 360.0)], [450, 450]),
    ],
)
def test_angles_that_turn_round(angles, expected):
    found = lengths(parts_by_direction(np.concatenate(angles)))
    assert len(found) == len(expected)
    assert sum(found) == sum(expected)
    assert np.max(np.abs(np.cumsum(found) - np.cumsum(expected))) <= 1


def test_an_axis_that_jitters_and_an_overshoot_are_no_new_run():
    rng = np.random.default_rng(1)
    settled = np.concatenate([UP, np.linspace(405.0, 360.0, 20)])
    assert len(parts_by_direction(settled + rng.normal(0.0, 0.5, len(settled)))) == 1


def test_pauses_times_that_begin_anew_and_empty_lines():
    t_s = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(100.0, 110.0, 0.1), np.arange(0.0, 10.0, 0.1)])
    lines = np.arange(300) + 2
    assert lengths(parts_by_gaps(t_s, lines, 2.0)) == [100, 100, 100]
    assert lengths(parts_by_gaps(t_s, lines, 200.0)) == [200, 100]
    lines[50:] += 1
    assert lengths(parts_by_gaps(None, lines, 2.0)) == [50, 250]


def test_the_slowest_circle_decides_what_a_pause_is():
    """At 1000 mm/min and 150 mm radius a degree takes 0.157 s."""
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    circles = [test.run(direction) for test in plan.tests.values() for direction in test.directions]
    slowest = max(circle.radius_mm for circle in circles)
    from dbbstation.trace.cut import LARGEST_GAP_DEG  # noqa: PLC0415 - the limit that runs are cut by

    assert longest_pause_s(circles) == pytest.approx(
        LARGEST_GAP_DEG * np.pi / 180.0 * slowest * 60.0 / 1000.0, rel=1e-3
    )
