"""Circles and centres over the plate, against closed forms and the figures of `evaluate`."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.calibration.checks.scatter import seats_of
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.calibration.reporting.evaluation import evaluate
from dbbstation.calibration.reporting.residual_map import CIRCLE_SECTORS, ball_shifts, circle_tests
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.trace.analysis import figures
from dbbstation.trace.recording import by_angle
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import draw_session


@pytest.fixture(scope="module")
def fit(reference):
    plan = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
    truth = MachineModel(reference, random_kinematics(reference, 5))
    return calibrate(reference, draw_session(truth, plan, np.random.default_rng(3), 3e-4, 360))


def test_curves_are_the_recording_less_the_circle_and_less_the_model(fit):
    tests = {one.name: one for one in circle_tests(fit)}
    assert list(tests) == list("abcdefghijklmno")
    for k, observation in enumerate(fit.observations):
        raw = observation.raw
        (circle,) = (one for one in tests[observation.test].circles if one.direction is raw.circle.direction)
        assert circle.theta_deg.shape == (CIRCLE_SECTORS,)
        # Two samples a sector, from -X or +X on: pairs by hand.
        pairs = (1e3 * (raw.length_mm - raw.circle.bar_mm)).reshape(-1, 2).mean(axis=1)
        left = (1e3 * fit.machine_residual_mm[k]).reshape(-1, 2).mean(axis=1)
        angle = np.mod(raw.circle.theta_deg(raw.phi_deg.reshape(-1, 2).mean(axis=1)), 360.0)
        order = np.argsort(angle)
        assert circle.theta_deg == pytest.approx(angle[order])
        # The nominal machine runs the plain circle about where the ball should be.
        assert circle.before_um == pytest.approx(pairs[order], abs=1e-3)
        assert circle.after_um == pytest.approx(left[order], abs=1e-6)


def test_centres_and_circularity_are_those_that_the_tables_have(fit):
    runs = evaluate(fit.model, fit.observations).runs
    models = [MachineModel(fit.model.machine), fit.model.of_the_machine()]
    for one in circle_tests(fit):
        own = [(o, run) for o, run in zip(fit.observations, runs, strict=True) if run.test == one.name]
        for row, (model, when) in enumerate(zip(models, ("before", "after"), strict=True)):
            left = [(o.raw, o.raw.length_mm - model.bar(o.motion()).length_mm) for o, _ in own]
            centres_mm = [figures(raw, raw.circle.bar_mm + residual).centre_mm for raw, residual in left]
            assert one.centre_um[row] == pytest.approx(1e3 * np.mean(centres_mm, axis=0), abs=1e-3)
            told = [getattr(run, when) for _, run in own]
            assert [1e3 * np.hypot(*centre) for centre in centres_mm] == pytest.approx(
                [f.centre_deviation_um for f in told]
            )
            assert one.circularity_um[row] == pytest.approx(max(f.circularity_um for f in told), abs=1e-3)
        (x, y, z) = next(o.setup.fixed_ball_mm for o in fit.observations if o.test == one.name)
        assert one.ball_mm == pytest.approx([x, y, z])


def test_balls_stand_where_the_fit_puts_them(fit):
    seats = seats_of(fit)
    balls = ball_shifts(fit)
    assert [ball.tests for ball in balls] == [(name,) for name in "abcdefghijklmno"]
    for ball, seat in zip(balls, seats, strict=True):
        assert ball.shift_um == pytest.approx(1e3 * seat.shift_mm[:2])
        assert ball.sigma_um == pytest.approx(1e3 * np.sqrt([seat.spread_mm2[0, 0], seat.spread_mm2[1, 1]]))
        # The holders' repeatability of 0.58 or 1.85 µm and 0.8 µm of the CMM.
        assert ball.stated_um == pytest.approx(np.hypot(0.58 if ball.tests[0] in "abcde" else 1.85, 0.8))


def test_by_angle_orders_a_clockwise_circle(fit):
    raw = next(o.raw for o in fit.observations if str(o.raw.circle.direction) == "cw")
    theta, (cosine,) = by_angle(raw, [np.cos(np.radians(raw.theta_deg))], 360)
    assert np.all(np.diff(theta) > 0.0)
    assert cosine == pytest.approx(np.cos(np.radians(theta)))
