"""Interpolation error of the bar: against quadrature signals, and whether a calibration's fit finds it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Observation
from dbbstation.plan.plan import Circle, Direction
from dbbstation.sources.causes.bar_cyclic import BarCyclic
from dbbstation.sources.causes.base_joints import BaseJoints
from dbbstation.sources.contract import Fitted, Motion, Need
from dbbstation.trace.recording import RawCircle
from tests.sources.runs import random_run, run

CYCLIC = BarCyclic()


def wave_um(reading_mm, reference, *values):
    motion = replace(random_run(np.random.default_rng(1), len(reading_mm)), reading_mm=reading_mm)
    return 1e3 * CYCLIC.effect(motion, reference, np.array(values)).reading_mm


def test_the_error_comes_again_after_every_signal_period(reference):
    x = 149.98 + np.linspace(0, 0.04, 81)
    here = wave_um(x, reference, 0.3, -0.4, 20.0)
    # 20 µm are 40 samples.
    assert np.allclose(here[40:], here[:-40], atol=1e-9)
    assert np.allclose(here[20:], -here[:-20], atol=1e-9)
    assert np.hypot(here[:-10], here[10:])[:60] == pytest.approx(np.full(60, 0.5), abs=1e-9)


def test_signals_of_another_zero_make_the_wave(reference):
    """Two signals, one of them 1 % of its size off zero, interpolated by the arc tangent [Heydemann]."""
    period = 20.0
    true_um = np.linspace(-30, 30, 400)
    phase = 2 * np.pi * true_um / period
    interpolated = np.unwrap(np.arctan2(np.sin(phase), np.cos(phase) + 0.01))
    error_um = (interpolated - phase) * period / (2 * np.pi)
    error_um -= np.round(error_um.mean() / period) * period
    size = 0.01 * period / (2 * np.pi)
    shown = 150.0 + (true_um + error_um) / 1e3
    assert np.allclose(wave_um(shown, reference, -size, 0.0, period), error_um, atol=0.02 * size)


def test_runs_of_the_same_bar_share_the_phase(reference):
    low, high = (150.0 + np.array([-0.031, -0.03, -0.029]), 150.0 + np.array([0.049, 0.05, 0.051]))
    assert np.allclose(wave_um(low, reference, 0.1, 0.2, 20.0), wave_um(high, reference, 0.1, 0.2, 20.0))


def test_a_model_puts_the_encoder_where_all_other_sources_put_it(reference, rng):
    joints = Fitted(BaseJoints(), rng.normal(0, 0.05, 18))
    sizes = np.array([0.2, 0.1, 20.0])
    motion = run((100, 0, -1008), (0, -15))
    without = MachineModel(reference, (joints,)).bar(motion).length_mm
    reading = MachineModel(reference, (joints, Fitted(CYCLIC, sizes, "session"))).bar(motion)
    assert np.ptp(without) > 0.04
    assert np.allclose(1e3 * (reading.length_mm - without), wave_um(without, reference, *sizes), atol=1e-9)
    assert len(reading.actual.motion.reading_mm) == len(motion)


def test_recordings_bring_the_readings():
    circle = Circle((0, 0, -1008), (0, 0, -1008), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)
    phi = np.arange(0, 360.0, 1.0)
    raw = RawCircle("a ccw 1", circle, phi / circle.turning_deg_s, phi, 150 + 1e-5 * phi)
    setup = random_run(np.random.default_rng(1)).setup
    motion = Observation("a", 1, raw, setup).motion()
    assert Need.READING in motion.provides
    assert np.array_equal(motion.reading_mm[motion.kept], raw.length_mm)


def test_readings_that_sweep_many_periods_tell_sine_cosine_and_period(reference, rng):
    x = 150 + 0.04 * np.sin(np.linspace(0, 2 * np.pi, 720, endpoint=False))
    truth = np.array([0.15, -0.08, 20.3])
    measured = wave_um(x, reference, *truth) + rng.normal(0, 0.1, len(x))
    motion = replace(random_run(rng, len(x)), reading_mm=x)
    values = np.array([0.1, 0.1, 20.0])
    for _ in range(20):
        jacobian = 1e3 * CYCLIC.derivative(motion, reference, values).reading_mm
        values = values + np.linalg.lstsq(jacobian, measured - wave_um(x, reference, *values), rcond=None)[0]
    sigma = 0.1 * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    assert np.all(np.abs(values - truth) < 4 * sigma)
    assert sigma[2] < 0.2


def test_readings_that_sweep_a_fifth_of_a_period_tell_nothing_beside_shift_and_length(reference):
    theta = np.linspace(0, 2 * np.pi, 720, endpoint=False)

    def left(sweep_um):
        x = 150 + 5e-4 * sweep_um * np.cos(theta)
        motion = replace(random_run(np.random.default_rng(1), len(x)), reading_mm=x)
        waves = CYCLIC.derivative(motion, reference, np.array([0.0, 0.0, 20.0])).reading_mm[:, :2]
        known = np.column_stack([np.ones_like(theta), *(f(k * theta) for k in (1, 2) for f in (np.cos, np.sin))])
        rest = waves - known @ np.linalg.lstsq(known, waves, rcond=None)[0]
        return np.linalg.norm(rest, axis=0) / np.linalg.norm(waves, axis=0)

    assert (left(4.0) < 0.03).all()
    assert (left(100.0) > 0.8).all()


def test_a_motion_without_readings_is_refused(reference, rng):
    with pytest.raises(ModelError, match=r"bar-cyclic needs reading, .* give recordings of the bar"):
        CYCLIC.effect(replace(random_run(rng), reading_mm=None), reference, np.array([0.1, 0.1, 20.0]))


def test_noise_of_the_readings_is_not_taken_for_a_wave(rng):
    count, noise_mm = 2000, 1e-3
    true_mm = 150.0 + 0.002 * np.sin(np.linspace(0.0, 2.0 * np.pi, count))
    alike = []
    for _ in range(30):
        noise = rng.normal(0.0, noise_mm, count)
        motion = Motion(np.zeros((count, 6)), reading_mm=true_mm + noise, reading_is_measured=True)
        waves = CYCLIC.derivative(motion, None, np.array([0.0, 0.0, 20.0])).reading_mm[:, :2]
        left = waves - waves.mean(axis=0)
        alike.append(left.T @ noise / (np.linalg.norm(left, axis=0) * noise_mm))
    # Of size one for waves that know nothing of the noise; the sine of the readings themselves has 20 and more.
    assert np.abs(np.mean(alike, axis=0)).max() < 3.0
    assert np.std(alike, axis=0).max() < 3.0


@pytest.mark.parametrize(("swept_um", "period_um", "shown"), [(50.0, 40.0, True), (50.0, 80.0, False)])
def test_runs_must_sweep_a_signal_period_to_show_it(swept_um, period_um, shown):
    x = 150.0 + 1e-3 * swept_um / 2.0 * np.cos(np.linspace(0.0, 2.0 * np.pi, 360))
    motions = [replace(random_run(np.random.default_rng(k), len(x)), reading_mm=x) for k in range(3)]
    assert CYCLIC.shows(motions, (period_um,)) is shown
