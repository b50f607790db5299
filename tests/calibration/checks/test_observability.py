"""What plans can see, computed from the plan alone; expected ranks from [CAL V] and [CAL III-A-2]."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.simulation import setup_of
from dbbstation.plan.plan import Plan
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import sources_named
from tests.calibration.checks.sensitivity import STEP_DEG, plan_sensitivity

SOURCES = sources_named(KINEMATIC_SOURCES)


@pytest.fixture(scope="module")
def plan():
    return read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")


def only(plan, names):
    return Plan(plan.name, {name: plan.tests[name] for name in names})


def raised(plan, names, elevation_deg=5.0):
    tests = dict(plan.tests)
    for name in names:
        circle = tests[name].circle
        x, y, z = circle.ball_mm
        height = z + circle.bar_mm * np.sin(np.radians(elevation_deg))
        tests[name] = replace(
            tests[name], circle=replace(circle, elevation_deg=elevation_deg, centre_mm=(x, y, height))
        )
    return Plan(plan.name, tests)


def test_the_fifteen_level_circles_see_23_parameters(reference, plan):
    """The "total 23 kinematic parameters" of [CAL V]: level bars do not see a common height."""
    seen = plan_sensitivity(reference, plan, SOURCES)
    assert seen.rank == 23
    _, _, vectors = np.linalg.svd(seen.matrix)
    height = np.zeros(24)
    height[8::3] = 1 / np.sqrt(6)
    assert abs(vectors[-1] @ height) == pytest.approx(1.0, abs=1e-9)


def test_without_their_centres_they_see_18(reference, plan):
    """The "at least six parameters must be prescribed" of [CAL III-A-2]."""
    assert plan_sensitivity(reference, plan, SOURCES, centred=True).rank == 18


def test_one_height_sees_21(reference, plan):
    assert plan_sensitivity(reference, only(plan, "fghij"), SOURCES).rank == 21


@pytest.mark.parametrize("names", ["abcde", "fghij", "klmno", "adgjm", "behkn"])
def test_any_five_raised_by_5_degrees_see_all_24(reference, plan, names):
    seen = plan_sensitivity(reference, raised(plan, names), SOURCES)
    assert seen.rank == 24
    assert 245 < seen.condition < 255


def test_the_matrix_is_the_finite_difference_of_the_readings(reference, plan):
    """Column by column, against the exact model of a machine wrong by a little."""
    two = only(plan, "dk")
    matrix = plan_sensitivity(reference, two, SOURCES).matrix
    phi = np.arange(0, 360, STEP_DEG)

    def readings(column, size):
        values = np.zeros(24)
        values[column] = size
        fitted = (Fitted(SOURCES[0], values[:6]), Fitted(SOURCES[1], values[6:]))
        model = MachineModel(reference, fitted)
        lengths = []
        for test in two.tests.values():
            motion = Motion(test.circle.poses(test.circle.theta_deg(phi)), setup=setup_of(test))
            lengths.append(model.bar(motion).length_mm)
        return np.concatenate(lengths)

    for column in range(24):
        slope = (readings(column, 1e-3) - readings(column, -1e-3)) / 2e-3
        assert np.allclose(slope, matrix[:, column], atol=1e-6)
