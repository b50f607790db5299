"""A jig plate that is warm or bent, against the figures of the reference plate and the geometry of a bent surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Plate
from dbbstation.sources.causes.base_joints import BaseJoints
from dbbstation.sources.causes.jig_distortion import JigDistortion
from dbbstation.sources.causes.jig_thermal import JigThermal
from dbbstation.sources.causes.strut_reference_length import StrutReferenceLength
from dbbstation.sources.causes.tool_ball_offset import ToolBallOffset
from dbbstation.sources.contract import Fitted, Motion, Setup
from tests.sources.runs import BORES_MM, JIG_TESTS, PLATE, jig_runs, run

WARM, BENT = JigThermal(), JigDistortion()


def at(x, y, z, plate=PLATE) -> Motion:
    origin = (0.0, 0.0, 0.0) if plate is None else plate.origin_mm
    setup = Setup("s", "m", "b", "bar", np.array([x, y, z]) + origin, 0.0, 0.0, 0.0, plate=plate)
    return Motion(np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0]]), setup=setup)


def shift_um(source, reference, motion, *values):
    return 1e3 * source.effect(motion, reference, np.array(values)).fixed_ball_mm


def test_corner_bores_and_risers_move_as_the_reference_plate_states(reference):
    """11.5 µm/(m K) over 141.4 mm and over 280 mm."""
    for x, y in BORES_MM.values():
        moved = shift_um(WARM, reference, at(x, y, 280.0), 1.0)
        assert np.hypot(*moved[:2]) == pytest.approx(1.6 if x and y else 1.15 if x or y else 0.0, abs=0.05)
        assert moved[2] == pytest.approx(3.2, abs=0.05)
        assert moved[:2] @ [-y, x] == pytest.approx(0.0, abs=1e-12)


def test_every_distance_between_balls_grows_alike(reference, rng):
    balls = rng.normal(0, 100, (6, 3))
    warm = balls + [1e-3 * shift_um(WARM, reference, at(*ball), 4.0) for ball in balls]
    here, there = (np.linalg.norm(b[:, None] - b, axis=2) for b in (balls, warm))
    assert np.allclose(there, here * (1 + 4 * 11.5e-6), rtol=1e-9)


def test_expansion_is_the_jig_files_else_that_of_steel(reference):
    for stated, expected in ((23.8, 23.8), (None, 11.5)):
        plate = replace(PLATE, expansion_um_m_k=stated)
        assert shift_um(WARM, reference, at(0, 0, 100.0, plate), 10.0)[2] == pytest.approx(expected)


@pytest.mark.parametrize("source", [WARM, BENT], ids=["warm", "bent"])
def test_a_ball_off_the_plate_stays(reference, source):
    sizes = np.ones(len(source.parameters(reference)))
    assert not shift_um(source, reference, at(70.0, -70.0, 142.0, None), *sizes).any()
    assert not shift_um(source, reference, Motion(np.zeros((1, 6))), *sizes).any()


def test_plans_say_on_which_plate_a_ball_stands():
    plan = read_plan(shipped_folder("fixtures") / "plans" / "every-key.yaml")
    reference = Plate((0.0, 0.0, -1150.0), 11.5)
    assert plan.tests["a"].ball.plate == plan.tests["raised"].ball.plate == reference
    assert plan.tests["short-bar"].ball.plate is None


def test_the_bar_reads_less_by_what_the_ball_comes_nearer(reference):
    motion = run((100, 0, -1150), (0, 0))
    warm = MachineModel(reference, (Fitted(WARM, np.array([5.0]), "session"),)).bar(motion).length_mm
    assert 1e3 * (warm[0] - 150.0) == pytest.approx(-5 * 1.15, abs=1e-3)
    assert 1e3 * (warm[90] - 150.0) == pytest.approx(+5 * 1.15, abs=1e-3)


@pytest.mark.parametrize("depth", [0.0, 60.0])
def test_balls_stand_on_the_normals_of_the_bent_plate(reference, rng, depth):
    bow, saddle, twist = sizes = rng.normal(0, 4, 3)

    def height(x, y):
        return 1e-3 * (bow * (x**2 + y**2) + saddle * (x**2 - y**2) + twist * 2 * x * y) / 100.0**2

    for x, y, z in rng.uniform([-120, -120, 0], [120, 120, 300], (8, 3)):
        step = 1e-2
        slope = [
            (height(x + step, y) - height(x - step, y)) / (2 * step),
            (height(x, y + step) - height(x, y - step)) / (2 * step),
        ]
        normal = np.array([-slope[0], -slope[1], 1.0])
        expected = [x, y, height(x, y) - depth] + (z + depth) * normal / np.linalg.norm(normal)
        moved_um = shift_um(BENT, reference, at(x, y, z), *sizes, depth)
        assert np.allclose(moved_um, 1e3 * (expected - [x, y, z]), atol=1e-3)


def test_a_bowed_plate_bends_on_a_circle(reference):
    """Height 8 µm at 100 mm is a radius of 100²/(2 · 0.008) mm; a ball above the middle turns about its centre."""
    radius = 100.0**2 / (2 * 0.008)
    angle = 100.0 / radius
    moved = 1e-3 * shift_um(BENT, reference, at(100.0, 0.0, 280.0), 8.0, 0.0, 0.0, 20.0)
    expected = [(radius - 300.0) * np.sin(angle) - 100.0, 0.0, radius - (radius - 300.0) * np.cos(angle) - 300.0]
    assert np.allclose(moved, expected, atol=1e-5)


def test_turned_axes_mix_saddle_and_twist_only(reference, rng):
    """A quarter turn of the plate turns the saddle's sign; by 45 degrees it is a twist."""
    x, y, z = rng.uniform(-100, 100, 3)
    quarter, eighth = np.radians([90.0, 45.0])

    def turned(angle, vector):
        c, s = np.cos(angle), np.sin(angle)
        return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])

    saddle = shift_um(BENT, reference, at(x, y, z), 0, 3.0, 0, 0)
    by_quarter = shift_um(BENT, reference, at(*turned(quarter, (x, y, z))), 0, -3.0, 0, 0)
    by_eighth = shift_um(BENT, reference, at(*turned(eighth, (x, y, z))), 0, 0, 3.0, 0)
    assert np.allclose(turned(quarter, saddle), by_quarter)
    assert np.allclose(turned(eighth, saddle), by_eighth)


def test_a_warm_plate_and_a_ball_off_the_tip_look_alike(reference):
    """What is left of both beside kinematics, with the scatter of holders, CMM and bar: correlated to 99 %.

    Balls 0.58 µm (short holder) or 1.85 µm (long) and the CMM's 0.8 µm off in every axis, the bar 0.5 µm, readings
    0.1 µm: generalised least squares with the dense covariance.
    """
    runs = jig_runs(step_deg=12.0)
    readings = [MachineModel(reference).bar(m) for m in runs]

    def columns(source):
        nothing = np.zeros(len(source.parameters(reference)))
        derivatives = [source.derivative(m, reference, nothing) for m in runs]
        return np.vstack([r.by_parameters(d) for r, d in zip(readings, derivatives, strict=True)])

    def moved(reading):
        return reading.sensitivity.direction[reading.actual.motion.kept]

    covariance = 1e-4**2 * np.eye(sum(len(r.length_mm) for r in readings)) + 5e-4**2
    rows = np.split(np.arange(len(covariance)), len(runs) // 2)
    for test, there, back, row in zip(JIG_TESTS.values(), readings[0::2], readings[1::2], rows, strict=True):
        by_ball = np.vstack([moved(there), moved(back)])
        scatter = np.hypot(0.58e-3 if test[1] == 1 else 1.85e-3, 0.8e-3)
        covariance[np.ix_(row, row)] += scatter**2 * by_ball @ by_ball.T
    white = np.linalg.inv(np.linalg.cholesky(covariance))
    kinematic = white @ np.hstack([columns(StrutReferenceLength()), columns(BaseJoints())])
    left, singular, _ = np.linalg.svd(kinematic, full_matrices=False)
    seen = left[:, singular > 1e-9 * singular[0]]

    def remains(column):
        return white @ column - seen @ (seen.T @ (white @ column))

    warm, low = remains(columns(WARM)[:, 0]), remains(columns(ToolBallOffset())[:, 2])
    cosine = warm @ low / np.linalg.norm(warm) / np.linalg.norm(low)
    assert abs(cosine) == pytest.approx(0.99, abs=0.005)
