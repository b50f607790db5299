"""What a test that could be measured would say: the products of its rows, the shift of its ball taken out, sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.diagnosis.channel import CircleChannel
from dbbstation.diagnosis.next_test import ForeseenTests
from dbbstation.inference.bounds import BOUNDS
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import Fitted, Motion, Need
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record


@pytest.fixture(scope="module")
def channel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("foreseen") / "session"
    errors = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
    record(folder, seed=11, plan=subset(table_ii_plan(11), "afg"), mechanisms=[errors], rate_hz=5.0)
    recorded = load_sessions([folder])
    return CircleChannel(
        calibrate(recorded.machine, recorded.observations), sources_named(["screw-lead", "strut-bending"])
    )


def by_finite_differences(channel, proposal, direction, source, plausible):
    """Readings by each amplitude, from those of machines that have a little of it, the ball's shift taken out, shape (n, p)."""
    circle = replace(proposal.circle, direction=direction)
    turn = np.linspace(-45.0, 360.0, BOUNDS.proposed_samples + BOUNDS.proposed_samples // 8, endpoint=False)[
        BOUNDS.proposed_samples // 8 :
    ]
    setup = replace(proposal.observation.setup, mounting="proposed")
    motion = Motion(circle.poses(circle.theta_deg(turn)), is_path=True, setup=setup)
    ball = MachineModel(channel.machine).bar(motion).sensitivity.direction
    columns = []
    for k, size in enumerate(1e-2 * plausible):
        little = size * (np.arange(len(plausible)) == k)
        plus, minus = (
            MachineModel(channel.machine, (Fitted(source, sign * little),)).bar(motion).length_mm
            for sign in (1.0, -1.0)
        )
        columns.append((plus - minus) / (2.0 * size))
    rows = np.column_stack(columns)
    return rows - ball @ np.linalg.lstsq(ball, rows, rcond=None)[0]


@pytest.mark.parametrize("direction", list(Direction))
def test_rows_have_the_products_of_all_samples_whatever_was_asked_before(channel, direction):
    could_be = ForeseenTests(channel)
    variants = [(cause.name, cause.variants[0]) for cause in channel.named]
    asked = [(channel.sources[name, variant.law], variant) for name, variant in variants]
    proposal = next(one for one in could_be.that_show({Need.POSE}) if one.circle.elevation_deg)
    samples = float(np.mean([len(o.raw) for o in channel.observations]))
    base = len(channel.base.prior)
    for order in (asked, asked[::-1]):
        rows = could_be.rows(proposal, [direction], order)
        size = np.concatenate([v.plausible for _, v in order])
        dense = (
            np.hstack([by_finite_differences(channel, proposal, direction, s, v.plausible) for s, v in order]) * size
        )
        products = size[:, None] * (rows[:, base:].T @ rows[:, base:]) * size
        assert products == pytest.approx(
            dense.T @ dense * samples / BOUNDS.proposed_samples, rel=1e-5, abs=1e-6 * products.max()
        )


def test_what_needs_time_is_proposed_later_and_at_other_feeds_too(channel):
    could_be = ForeseenTests(channel)
    at_once = could_be.that_show({Need.POSE})
    later = could_be.that_show({Need.POSE, Need.PATH, Need.TIME})
    assert {one.wait_s for one in at_once} == {0.0}
    assert {one.wait_s for one in later} == {0.0, 3600.0}
    balls = {one.observation.setup.ball for one in at_once}
    assert len(later) == 2 * len(at_once) + 2 * len(balls)
