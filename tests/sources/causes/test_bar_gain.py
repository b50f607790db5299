"""The gain of the bar's scale: by hand, why one size of circle cannot show it, and found by the independent plant's circles of two sizes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.inference.levels import Verdict
from dbbstation.sources.causes.bar_gain import BarGain
from studies.diagnosed import diagnose_sessions
from tests.plant.mechanisms.disturbances import BarScale
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.noise import Noise
from tests.plant.plan import Path, subset, table_ii_plan
from tests.plant.session import record
from tests.sources.runs import random_run

pytestmark = pytest.mark.usefixtures("few_parts")

GAIN = BarGain()
KINEMATICS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)


def test_the_error_is_in_proportion_to_the_commanded_way(reference):
    motion = random_run(np.random.default_rng(1), 4)
    ball = motion.setup.fixed_ball_mm
    poses = motion.poses.copy()
    poses[:, :3] = ball + np.array([[150.0, 0, 0], [0, 147.0, 0], [0, 0, 151.0], [-144.0, 0, 0]])
    motion = replace(motion, poses=poses, setup=replace(motion.setup, bar_length_mm=150.0))
    error_um = 1e3 * GAIN.effect(motion, reference, np.array([2.0])).reading_mm
    assert error_um == pytest.approx([0.0, -6.0, 2.0, -12.0])
    unknown = replace(motion, setup=replace(motion.setup, bar_length_mm=None))
    assert not GAIN.effect(unknown, reference, np.array([2.0])).reading_mm.any()


def test_one_size_of_circle_shows_errors_of_geometry_that_are_as_much_larger(tmp_path):
    """The independent plant without noise: a tenth too much on the scale, and geometric errors a tenth larger, read the same."""
    share = 0.1
    larger = RandomKinematics(length_sd_mm=0.05 * (1.0 + share), base_sd_mm=0.05 * (1.0 + share))
    alone = read(tmp_path / "alone", KINEMATICS)
    scaled = read(tmp_path / "scaled", KINEMATICS, BarScale(linear_um=100.0 * share, curved_um=0.0))
    geometry = read(tmp_path / "geometry", larger)
    whole_um = 1e3 * float(np.abs(scaled - alone).max())
    assert whole_um > 10.0
    assert 1e3 * float(np.abs(scaled - geometry).max()) < 0.01 * whole_um


def read(folder, *mechanisms):
    truth = record(folder, seed=3, mechanisms=mechanisms, setup=(), noise=Noise(white_um=0.0), rate_hz=2.0)
    # On the way in and out the bar is pulled out by 1.5 mm, which is commanded.
    return np.concatenate([run.length_mm[run.in_circle] for run in truth.runs])


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [4.0, pytest.param(10.0, marks=pytest.mark.nightly)])
def test_circles_of_two_sizes_find_it_and_circles_of_one_say_that_they_cannot(tmp_path, rate_hz):
    plan = subset(table_ii_plan(1), "abfhkn")
    smaller = Path(radius_mm=147.0)
    two = replace(plan, tests=tuple(replace(t, path=smaller) if k % 2 else t for k, t in enumerate(plan.tests)))
    scale = BarScale(linear_um=0.3, curved_um=0.0, set_at_mm=150.0)
    found = gain_of(tmp_path / "two", two, scale, rate_hz)
    assert found.verdict is Verdict.IDENTIFIED
    value = found.parameters["gain_um_mm"]
    assert value.value == pytest.approx(3.0, abs=4.0 * value.uncertainty)
    assert value.uncertainty < 0.5
    assert gain_of(tmp_path / "one", plan, scale, rate_hz).verdict is Verdict.NOT_TESTABLE


def gain_of(folder, plan, scale, rate_hz):
    record(folder, seed=1512, plan=plan, mechanisms=[KINEMATICS, scale], rate_hz=rate_hz)
    found = diagnose_sessions([folder], ("bar-gain", "bar-scale"), (), lambda _: None).diagnosis
    return next(f for f in found.sources if f.name == "bar-gain")
