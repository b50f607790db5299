"""Sessions drawn with balls under the spindle: what the micrometer reads is how they stand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.virtual.truth import random_kinematics
from studies.virtual_session import BAR_UNCERTAINTY_MM, draw_session
from tests.virtual.brute_force import tool

if TYPE_CHECKING:
    from dbbstation.machine.geometry import Machine
    from dbbstation.model.observation import Observation

SAMPLES = 36


def drawn(reference: Machine, micrometer_mm: float | None) -> list[Observation]:
    plan = read_plan(shipped_folder("protocols") / "plans" / "conventional.yaml")
    truth = MachineModel(reference, random_kinematics(reference, 8))
    return draw_session(truth, plan, np.random.default_rng(8), 0.0, SAMPLES, micrometer_mm)


def test_readings_with_a_perfect_micrometer_explain_the_lengths(reference: Machine) -> None:
    truth = MachineModel(reference, random_kinematics(reference, 8))
    offsets = []
    for observation in drawn(reference, 0.0):
        setup, circle = observation.setup, observation.raw.circle
        assert not setup.place_known
        assert setup.set_up_errors is not None
        tip, _ = tool(truth, np.array([*setup.fixed_ball_mm, *circle.tilt_deg]))
        ball = tip + setup.set_up_errors.fixed_ball_mm
        poses = circle.poses(circle.theta_deg(observation.raw.phi_deg))
        for k in (0, 13, 29):
            tip, turn = tool(truth, poses[k])
            length = np.linalg.norm(tip + turn @ setup.set_up_errors.moving_ball_mm - ball)
            offsets.append(observation.raw.length_mm[k] - length)
    # What is left is the length error of the bar, one number for all.
    assert np.ptp(offsets) < 1e-7
    assert abs(offsets[0]) < 4.0 * BAR_UNCERTAINTY_MM


def test_the_micrometer_changes_nothing_but_what_is_known(reference: Machine) -> None:
    blind, read = drawn(reference, None), drawn(reference, 0.001)
    assert {observation.setup.set_up_errors for observation in blind} == {None}
    for a, b in zip(blind, read, strict=True):
        np.testing.assert_array_equal(a.raw.length_mm, b.raw.length_mm)
    exact = drawn(reference, 0.0)
    off = [
        b.setup.set_up_errors.moving_ball_mm - a.setup.set_up_errors.moving_ball_mm
        for a, b in zip(exact, read, strict=True)
    ]
    assert np.std(off) == pytest.approx(0.001, rel=0.3)
    assert read[0].setup.set_up_errors.uncertainty_mm == 0.001
