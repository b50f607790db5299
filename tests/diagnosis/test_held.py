"""Directions that no run can see: what is said of them holds on machines whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import calibrate, default_sources
from dbbstation.diagnosis.verdicts import held_beside, held_variance
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.disturbances import BumpedJig
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.mechanisms.set_up import ToolBallOffset
from tests.plant.session import record

OFFSET_MM = 0.12


@pytest.mark.parametrize("sessions", [4, pytest.param(8, marks=pytest.mark.nightly)])
def test_a_ball_off_the_tool_tip_is_as_uncertain_where_no_circle_sees_it_as_it_is_large_elsewhere(tmp_path, sessions):
    source = sources_named(["tool-ball-offset"])
    towards = np.random.default_rng(3).standard_normal((sessions, 3))
    offsets = OFFSET_MM * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    of_ball, of_base, known = [], [], []
    for k, offset in enumerate(offsets):
        kinematics = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)
        folder = tmp_path / f"{k}"
        truth = record(folder, seed=k, mechanisms=[kinematics], setup=[ToolBallOffset(tuple(offset))], rate_hz=5.0)
        recorded = load_sessions([folder])
        before = calibrate(recorded.machine, recorded.observations)
        after = calibrate(recorded.machine, recorded.observations, [*default_sources(), *source])
        beside = held_beside(before, after)
        assert len(before.solution.held) == len(beside) == 1
        covariance = np.diag(after.solution.covariance)
        sigma = np.sqrt(covariance + held_variance(after, beside))
        ball, _ = after.layout.columns_of("tool-ball-offset")
        base, _ = after.layout.columns_of("base-joints")
        across = np.arange(len(base)) % 3 < 2  # all heights together are the base fit's own held direction
        of_ball.append((after.x[ball] - offset) / sigma[ball])
        of_base.append(((after.x[base] - np.ravel(truth.delta_base_mm)) / sigma[base])[across])
        known.append((after.x[ball] - offset) / np.sqrt(covariance[ball]))
    assert 0.4 < _rms(of_ball) < 1.8
    assert 0.4 < _rms(of_base) < 1.8
    assert _rms(known) > 3.0


def test_heights_that_no_circle_shows_stay_at_nominal_beside_a_table_that_was_raised(tmp_path):
    """A ball that is z off reads z²/2R more: beside balls that were raised, all base joints together would show, if only so."""
    record(
        tmp_path / "s",
        seed=34,
        mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05), BumpedJig((15.0, 11.0, 0.0), from_run=9)],
        rate_hz=5.0,
    )
    recorded = load_sessions([tmp_path / "s"])
    before = calibrate(recorded.machine, recorded.observations)
    sources, start = [*default_sources(), *sources_named(["jig-bump"])], {"jig-bump": np.array([15.0, 11.0, 80.0, 9.0])}

    def moved(also_held):
        fit = calibrate(recorded.machine, recorded.observations, sources, start, also_held=also_held)
        base = np.flatnonzero(~before.layout.known.random)
        along = before.solution.held @ (
            (fit.x - fit.layout.nominal)[: len(before.x)][base] / before.layout.known.scale[base]
        )
        return float(np.abs(along).max())

    assert moved(before.solution.held) < 1e-9
    assert moved(None) > 0.1


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
