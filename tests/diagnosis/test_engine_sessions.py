"""The sessions for the diagnosis are what their answers say."""

from __future__ import annotations

import numpy as np
import pytest

from tests.diagnosis import engine_sessions
from tests.diagnosis.engine_sessions import (
    COLOURED,
    RECIPES,
    answer,
    screw_wave_under_coloured_noise,
    warm_up_in_two_stages_and_warm_frame,
)
from tests.plant.run import Motion
from tests.plant.simulate import true_platform


def test_answers_name_what_is_hidden(tmp_path, monkeypatch):
    monkeypatch.setattr(engine_sessions, "RATE_HZ", 1.0)  # answers say nothing of it
    told = {name: answer(recipe(tmp_path / name)) for name, recipe in RECIPES.items()}
    assert {name: one["effects"] for name, one in told.items()} == {
        "screw-lead-and-gravity": ["screw-lead", "gravity"],
        "gravity-backlash-and-screw-cyclic": ["gravity", "backlash", "screw-cyclic"],
        "warm-up-of-unknown-time-constant": ["thermal-struts"],
        "warm-up-in-two-stages": ["thermal-struts"],
        "warm-up-in-two-stages-and-warm-frame": ["thermal-struts", "thermal-frame"],
        "screw-wave-under-coloured-noise": ["screw-cyclic"],
        "bar-that-wanders": ["wandering-bar"],
        "strut-with-a-kink": ["kinked-strut"],
        "curved-scale-of-the-bar": ["bar-scale"],
        "jig-bumped-once": ["bumped-jig"],
        "strut-that-rings": ["ringing-strut"],
    }
    assert all((tmp_path / name / "session.yaml").exists() for name in RECIPES)


def test_the_frame_ends_as_far_out_as_it_was_told_to(tmp_path):
    truth = warm_up_in_two_stages_and_warm_frame(tmp_path / "s", outwards_um=6.0)
    at_home = np.array([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0]])
    motion = Motion(truth.scene, np.array([100.0 * 5400.0]), at_home)
    base_mm = true_platform(motion, truth.mechanisms[-4:-3]).base_mm[0]
    assert truth.mechanisms[-4].name == "thermal-frame"
    outwards_mm = np.linalg.norm(base_mm, axis=1) - np.linalg.norm(truth.nominal.base_joints_mm, axis=1)
    assert 1e3 * outwards_mm == pytest.approx([6.0] * 6, rel=1e-6)


def test_noise_is_as_loud_as_the_answer_says(tmp_path):
    told = answer(screw_wave_under_coloured_noise(tmp_path / "s"))
    noise_um = 1e3 * COLOURED.drawn_mm(np.random.default_rng(3), 400_000)
    assert told["noise_total_um"] == pytest.approx(noise_um.std(), rel=0.005)
    # Loudness at low frequencies: means of long stretches, as white noise of that size would scatter them.
    means_um = noise_um.reshape(-1, 100).mean(axis=1)
    assert told["noise_slow_um"] == pytest.approx(10.0 * means_um.std(), rel=0.04)
