"""Figures before and after, and the plane's, against cases that can be worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.calibration.reporting.evaluation import evaluate, plane_figures
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Observation
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.contract import Fitted, Setup
from dbbstation.sources.registry import known_sources
from dbbstation.trace.recording import RawCircle

PHI = np.arange(0, 360, 1.0)


def observation(test, shift_um, grow_um=0.0):
    circle = Circle((0, 0, -1008), (0, 0, -1008), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
    theta = np.radians(PHI)
    length = 150 + 1e-3 * (shift_um * np.cos(theta) + grow_um)
    setup = Setup("s", test, test, "bar", np.array(circle.ball_mm), 0.0, 0.0, 0.0)
    return Observation(test, 1, RawCircle(test, circle, PHI * 0.1, PHI, length), setup)


def test_centres_are_counted_from_the_ball_and_from_the_first_position(reference):
    found = evaluate(MachineModel(reference), [observation("a", 30.0, 5.0), observation("b", 12.0)])
    a, b = found.runs
    assert a.before.centre_deviation_um == pytest.approx(30.0, abs=0.01)
    assert a.before.mean_radial_error_um == pytest.approx(5.0, abs=0.01)
    assert tuple(run.before.centre_deviation_from_first_um for run in (a, b)) == (0.0, pytest.approx(18.0, abs=0.01))
    assert found.nominal_rms_um == pytest.approx(np.sqrt((30**2 / 2 + 25 + 12**2 / 2) / 2), rel=1e-3)


def test_after_is_what_the_model_leaves(reference):
    shift = np.tile([0.03, 0.0, 0.0], 6)
    model = MachineModel(reference, (Fitted(known_sources()["base-joints"], shift),))
    (run,) = evaluate(model, [observation("a", 30.0)]).runs
    assert run.before.centre_deviation_um == pytest.approx(30.0, abs=0.01)
    assert run.after.centre_deviation_um == pytest.approx(0.0, abs=0.01)
    assert run.measured.circularity_um == pytest.approx(run.before.circularity_um, abs=1e-6)
    assert run.measured.centre_deviation_um == pytest.approx(run.before.centre_deviation_um, abs=1e-6)


def test_a_base_that_is_turned_makes_the_plane_slope(reference):
    turn = 1e-4
    for axis, flatness, parallelism in ((0, 380 * turn, 0.0), (1, 380 * turn, 0.0), (2, 0.0, 380 * turn)):
        shift = np.cross(turn * np.eye(3)[axis], reference.hexapod.base_joints_mm).ravel()
        model = MachineModel(reference, (Fitted(known_sources()["base-joints"], shift),))
        figures = plane_figures(model, -1008.0)
        assert figures.flatness_um == pytest.approx(1e3 * flatness, abs=0.1)
        assert figures.parallelism_um == pytest.approx(1e3 * parallelism, abs=0.1)
        cured = plane_figures(model, -1008.0, corrected=model)
        assert cured.flatness_um == pytest.approx(0.0, abs=1e-6)
