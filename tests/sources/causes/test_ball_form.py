"""A ball that is not round, against its definition on the sphere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import sph_harm_y

from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.ball_form import BallForm
from dbbstation.sources.contract import Fitted, Motion, Owner
from tests.sources.runs import concealed_share, jig_runs, random_run, run

FORM = BallForm()
THETA = np.radians(np.arange(0, 360, 1.0))


@pytest.mark.parametrize("order", [2, 3, 4, 5])
@pytest.mark.parametrize("tilt", [(0, 0), (-10, 10)])
def test_a_level_bar_reads_low_where_the_ball_stands_proud(reference, order, tilt):
    um = np.zeros(8)
    um[2 * (order - 2)], um[2 * (order - 2) + 1] = 0.3, -0.2
    reading = (
        MachineModel(reference, (Fitted(FORM, um, "bar"),)).bar(run((100, 0, -1008), tilt, step_deg=1.0)).length_mm
    )
    expected_um = -0.3 * np.cos(order * THETA) + 0.2 * np.sin(order * THETA)
    assert np.allclose(1e3 * (reading - 150.0), expected_um, rtol=0, atol=1e-6)


def test_both_directions_show_one_figure(reference):
    um = np.arange(1.0, 9.0) / 10
    model = MachineModel(reference, (Fitted(FORM, um, "bar"),))
    ccw, cw = (model.bar(run((0, 0, -1150), (0, 0), clockwise=c, step_deg=1.0)).length_mm for c in (False, True))
    assert np.ptp(ccw) > 1e-3
    assert np.allclose(ccw, np.roll(cw[::-1], 1), rtol=0, atol=1e-9)


def test_columns_are_sectoral_harmonics_of_the_sphere(reference, rng):
    motion = random_run(rng)
    away = motion.poses[:, :3] - motion.setup.fixed_ball_mm
    polar = np.arccos(away[:, 2] / np.linalg.norm(away, axis=1))
    theta = np.arctan2(away[:, 1], away[:, 0])
    columns = FORM.derivative(motion, reference, np.zeros(8)).reading_mm
    for k in (2, 3, 4, 5):
        harmonic = sph_harm_y(k, k, polar, theta) / sph_harm_y(k, k, np.pi / 2, 0.0).real
        pair = -1e-3 * np.column_stack([harmonic.real, harmonic.imag])
        assert np.allclose(columns[:, 2 * (k - 2) : 2 * (k - 2) + 2], pair, atol=1e-15)


def test_what_is_left_open_is_higher_orders_and_other_latitudes_of_the_sphere(reference, rng):
    motion = random_run(rng)
    away = motion.poses[:, :3] - motion.setup.fixed_ball_mm
    polar = np.arccos(away[:, 2] / np.linalg.norm(away, axis=1))
    theta = np.arctan2(away[:, 1], away[:, 0])
    um = np.array([0.3, -0.2, 0.5, 0.1, 0.0, 0.4, 0.2, -0.1])
    left_open = FORM.left_open(motion, reference, um).reading_mm
    every = np.hstack([FORM.derivative(motion, reference, um).reading_mm, left_open])
    assert left_open.shape == (len(motion), 22)
    for k in (2, 3, 4, 5):
        for degree in (k + 1, k + 2):
            wanted = sph_harm_y(degree, k, polar, theta).real
            left = wanted - every @ np.linalg.lstsq(every, wanted, rcond=None)[0]
            assert np.abs(left).max() < 1e-9 * np.abs(wanted).max()
    for at, k in enumerate((6, 7, 8)):
        proud = np.sin(polar) ** k * np.cos(k * theta)
        assert np.allclose(left_open[:, 2 * at], -1e-3 * 0.2 * np.sqrt(np.mean(um**2)) * proud, atol=1e-15)
    assert not FORM.left_open(Motion(motion.poses), reference, um).reading_mm.any()


def test_runs_with_one_bar_share_it(reference, rng):
    motion = random_run(rng)
    other = replace(motion, setup=replace(motion.setup, session="tomorrow", mounting="another"))
    assert FORM.belongs_to is Owner.INSTRUMENT
    assert FORM.shared_by(motion) == FORM.shared_by(other) == "bar"
    bare = Motion(motion.poses)
    assert not FORM.effect(bare, reference, np.ones(8)).reading_mm.any()


def test_joints_can_take_the_oval_but_not_the_lobes(reference):
    share = concealed_share(reference, jig_runs(4.0), lambda m: FORM.derivative(m, reference, np.zeros(8)))
    assert (share[:2] > 0.3).all()
    assert (share[2:] < 0.1).all()
