"""Where a turn begins: exact on a displaced circle, its derivative, and its size against edges cut again and again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.simulation import setup_of
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.load import load_sessions
from dbbstation.trace.cut import start_uncertainty_deg
from dbbstation.trace.recording import Recording
from dbbstation.virtual.truth import random_kinematics
from tests.plant.session import record

SOURCE = known_sources()["run-start"]


@pytest.fixture
def case(reference):
    test = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml").tests["h"]
    return MachineModel(reference, random_kinematics(reference, 3)), test


def motion(test, direction, shift_deg=0.0):
    circle = test.run(direction)
    phi = np.arange(-45.0, 360.0, 0.5)
    setup = replace(setup_of(test), run="h", start_uncertainty_deg=0.1)
    return Motion(circle.poses(circle.theta_deg(phi + shift_deg)), is_path=True, kept=slice(90, 800), setup=setup)


@pytest.mark.parametrize("which", [0, 1])
def test_it_is_the_circle_begun_elsewhere(case, which):
    truth, test = case
    direction = test.directions[which]
    late = Fitted(SOURCE, np.array([0.3]), "h")
    with_late = replace(truth, sources=(*truth.sources, late)).bar(motion(test, direction)).length_mm
    shifted = truth.bar(motion(test, direction, 0.3)).length_mm
    assert np.abs(shifted - truth.bar(motion(test, direction)).length_mm).max() > 1e-4
    assert with_late == pytest.approx(shifted, abs=2e-6)


def test_an_exact_machine_shows_nothing_of_it(reference, case):
    _, test = case
    late = Fitted(SOURCE, np.array([0.3]), "h")
    reading = MachineModel(reference, (late,)).bar(motion(test, test.directions[0])).length_mm
    assert np.abs(reading - 150.0).max() < 1e-8


def test_derivative(case):
    truth, test = case
    moved = motion(test, test.directions[1])

    def reading(late):
        sources = (*truth.sources, Fitted(SOURCE, np.array([late]), "h"))
        return replace(truth, sources=sources).bar(moved)

    analytic = reading(0.1).by_source(SOURCE, truth.machine, np.array([0.1]))[:, 0]
    numeric = (reading(0.101).length_mm - reading(0.099).length_mm) / 0.002
    assert analytic == pytest.approx(numeric, abs=1e-7)


def test_the_stated_size_is_that_of_edges_between_samples(rng):
    circle = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml").tests["a"].circle
    spacing = 0.2
    errors = []
    for _ in range(4000):
        edges = rng.uniform(0.0, spacing, 2) + np.array([0.0, 80.0])
        found = (np.floor(edges / spacing) + 0.5) * spacing
        errors.append((found - edges).mean())
    expected_deg = np.std(errors) * circle.turning_deg_s
    times = np.arange(0.0, 80.0, spacing)
    told = start_uncertainty_deg(Recording("", times, np.full(len(times), 150.0)), circle)
    assert told == pytest.approx(expected_deg, rel=0.05)


def test_quick_recordings_and_recorded_angles_need_none(tmp_path):
    for name, rate, angles, some in (
        ("slow", 10.0, False, True),
        ("quick", 50.0, False, False),
        ("told", 10.0, True, False),
    ):
        record(tmp_path / name, seed=3, rate_hz=rate, angles=angles)
        runs = load_sessions([tmp_path / name]).observations
        assert all((run.motion().setup.start_uncertainty_deg > 0.0) is some for run in runs)
