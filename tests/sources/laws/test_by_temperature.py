"""Growth by thermometers, against linear expansion written out; which thermometer counts; what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames
from dbbstation.machine.kinematics import inverse
from dbbstation.sources.contract import Thermometer
from dbbstation.sources.laws.temperature import following_thermometers
from dbbstation.sources.registry import sources_named
from dbbstation.trace.columns import temperatures
from tests.sources.runs import random_run

STRUTS, FRAME, BAR = (
    source.by_temperature() for source in sources_named(["thermal-struts", "thermal-frame", "bar-drift"])
)
EACH = {f"strut{k + 1}": 20.0 + 0.5 * k for k in range(6)}


def run_at(rng, **degc):
    """A run under thermometers that showed 20 degC when the session began, and these now."""
    motion = random_run(rng)
    ends = np.array([-1e6, motion.time_s[0] - 1.0, motion.time_s[-1] + 1.0])
    shown = {name: Thermometer(ends, np.array([20.0, value, value])) for name, value in degc.items()}
    # What a run itself shows is coarser than the session's curve, which counts.
    logged = {name: np.full(len(motion), np.round(value)) for name, value in degc.items()}
    return replace(motion, logged=temperatures(logged), setup=replace(motion.setup, thermometers=shown))


def test_struts_grow_by_the_thermometers_on_them(reference, rng):
    motion = run_at(rng, machine=35.0, **EACH)
    effect = STRUTS.effect(motion, reference, np.array([11.5])).strut_mm
    length_mm = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    assert np.allclose(effect, 11.5e-6 * length_mm * 0.5 * np.arange(6), rtol=1e-12, atol=0)


def test_struts_grow_by_that_of_the_machine_where_one_of_theirs_is_missing(reference, rng):
    motion = run_at(rng, machine=22.4, **{name: degc for name, degc in EACH.items() if name != "strut4"})
    effect = STRUTS.effect(motion, reference, np.array([10.0])).strut_mm
    length_mm = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
    assert np.allclose(effect, 10e-6 * length_mm * 2.4, rtol=1e-12, atol=0)


def test_joints_and_bar(reference, rng):
    motion = run_at(rng, machine=23.0, bar=19.0)
    shift = FRAME.effect(motion, reference, np.array([12.0])).base_joint_mm
    assert np.allclose(shift, 12e-6 * 3.0 * reference.hexapod.base_joints_mm)
    assert np.allclose(BAR.effect(motion, reference, np.array([1.6])).reading_mm, -1.6e-3)


def test_without_its_thermometer_it_is_refused_by_name(reference, rng):
    motion = run_at(rng, bar=19.0)
    with pytest.raises(
        ModelError, match=r"thermal-frame follows a thermometer, and not every run .* has machine_temp_c"
    ) as caught:
        FRAME.effect(motion, reference, np.array([12.0]))
    assert "column" in caught.value.remedy
    with pytest.raises(ModelError, match=r"machine_temp_c|strut4_temp_c") as both:
        STRUTS.require(run_at(rng, **{name: degc for name, degc in EACH.items() if name != "strut4"}))
    assert "strut4_temp_c, or machine_temp_c" in both.value.what
    with pytest.raises(ModelError, match="needs temperature"):
        FRAME.require(replace(motion, logged={}))


def test_thermometers_are_followed_where_every_run_has_them(rng):
    frame, bar, gravity = sources_named(["thermal-frame", "bar-drift", "gravity"])
    still = following_thermometers([frame], [run_at(rng, machine=20.1)])
    assert [source.varies_with for source in still] == ["time"]  # nothing to follow
    with_machine, with_both = run_at(rng, machine=21.0), run_at(rng, machine=21.0, bar=21.0)
    follow = following_thermometers([frame, bar, gravity], [with_both, with_machine])
    assert [source.varies_with for source in follow] == ["temperature", "time", gravity.varies_with]
    assert [source.name for source in follow] == ["thermal-frame", "bar-drift", "gravity"]
