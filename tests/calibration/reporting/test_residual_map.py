"""Maps over test and angle: means that one can write down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.reporting.residual_map import SECTORS, names_of_tests, residual_map
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from studies.virtual_session import draw_session


@pytest.fixture(scope="module")
def runs(reference):
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    return draw_session(MachineModel(reference), plan, np.random.default_rng(1), 0.0, 720)


def test_cells_are_means_over_ten_degrees_from_x_in_both_directions(runs):
    """A residual of 2 cos(theta) µm has the mean 2 (sin b - sin a) / (b - a) from a to b."""
    residual = [2e-3 * np.cos(np.radians(o.raw.theta_deg)) for o in runs]
    seen = residual_map(runs, residual)
    edges = np.radians(np.linspace(0, 360, SECTORS + 1))
    expected = 2.0 * np.diff(np.sin(edges)) / np.diff(edges)
    assert seen.tests == tuple("abcdefghijklmno")
    for direction in Direction:
        assert seen.um[direction].shape == (15, SECTORS)
        # Twenty samples per cell, half a degree apart, lie up to a quarter of a degree off its middle.
        assert seen.um[direction] == pytest.approx(np.tile(expected, (15, 1)), abs=2 * np.radians(0.3))
    assert seen.reach_um == pytest.approx(np.abs(expected).max(), abs=0.01)


def test_noise_is_taken_off(runs):
    rough = [1e-3 * np.cos(np.radians(100 * o.raw.theta_deg)) for o in runs]
    assert residual_map(runs, rough).reach_um < 1e-6


def test_a_direction_that_was_not_recorded_is_left_open(runs):
    kept = [o for o in runs if o.test != "c" or o.raw.circle.direction is Direction.CW]
    seen = residual_map(kept, [np.ones(len(o.raw)) for o in kept])
    assert np.isnan(seen.um[Direction.CCW][2]).all()
    assert seen.um[Direction.CW] == pytest.approx(np.full((15, SECTORS), 1e3))


def test_rows_are_told_apart(runs):
    a = runs[:2]
    assert names_of_tests(a) == ["a", "a"]
    again = [*a, *(replace(o, repeat=2) for o in a)]
    assert names_of_tests(again) == ["a 1", "a 1", "a 2", "a 2"]
    other = [replace(o, setup=replace(o.setup, session="tuesday")) for o in a]
    assert names_of_tests([*a, *other]) == ["study a", "study a", "tuesday a", "tuesday a"]
