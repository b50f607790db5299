"""Currents of strut drives: closed forms by hand, and what they share with the other sources of load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Frames, StrutMasses
from dbbstation.machine.kinematics import forward, inverse
from dbbstation.sources.causes.drive_friction import TURNED_OVER_MM, DriveFriction, driven_directions
from dbbstation.sources.contract import Motion
from dbbstation.trace.columns import currents
from tests.sources.runs import random_machine, random_run, run

DRIVES = DriveFriction()
GAIN_A_KN, COULOMB_N, VISCOUS_NS_MM, SHARE_N_KN, ASYMMETRY_N = 2.5, 120.0, 3.0, 60.0, 7.0
VALUES = np.tile([GAIN_A_KN, COULOMB_N, VISCOUS_NS_MM, SHARE_N_KN, ASYMMETRY_N], 6)


def all_struts(reference, lengths_mm, time_s, load_n=None) -> Motion:
    """The platform moved so that every strut is longer by the same amounts than at home, which is along Z."""
    home = np.array([0.0, 0.0, -1008.0, 0.0, 0.0, 0.0])
    start = Frames.from_poses(np.tile(home, (len(lengths_mm), 1)), reference.hexapod.rotation)
    first = inverse(reference.hexapod, start).length_mm
    frames = forward(reference.hexapod, first + np.asarray(lengths_mm)[:, None], start)
    return Motion(
        frames.to_poses(reference.hexapod.rotation),
        is_path=True,
        time_s=np.asarray(time_s, dtype=float),
        logged=currents(np.zeros((len(lengths_mm), 6))),
        load_n=load_n,
    )


@pytest.mark.parametrize("load_n", [900.0, -400.0])
def test_constant_load_both_ways_gives_load_and_friction_by_hand(reference, load_n):
    speed, time = 4.0, np.arange(0.0, 20.0, 0.5)
    travel = speed * np.where(time < 10.0, time, 20.0 - time)
    motion = all_struts(reference, travel, time, np.full((len(time), 6), load_n))
    current = DRIVES.effect(motion, reference, VALUES).current_a
    out, back = current[5], current[-5]
    k = GAIN_A_KN / 1000
    assert np.allclose((out + back) / 2, k * (load_n - ASYMMETRY_N), rtol=1e-9)
    friction = COULOMB_N + SHARE_N_KN / 1000 * abs(load_n) + VISCOUS_NS_MM * speed
    assert np.allclose((back - out) / 2, k * friction, rtol=1e-6)
    assert (out < back).all()  # a load that pulls helps to pay out


def test_a_pulled_strut_needs_a_positive_current(reference):
    motion = all_struts(reference, [0.0, 1.0], [0.0, 1.0])
    gains = np.tile([GAIN_A_KN, 0.0, 0.0, 0.0, 0.0], 6)
    struts = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation))
    expected_n = 400.0 * 9.81 / 6 / -struts.unit[:, :, 2]
    assert np.allclose(DRIVES.effect(motion, reference, gains).current_a, GAIN_A_KN / 1000 * expected_n, rtol=1e-6)


def test_a_motor_holds_the_weight_of_what_it_moves(reference):
    """Half a telescope of 30 kg and a screw of 10 kg hang along the strut; the rest is across it, see the statics."""
    motion = all_struts(reference, [0.0, 1.0], [0.0, 1.0])
    gains = np.tile([1.0, 0.0, 0.0, 0.0, 0.0], 6)
    struts = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation))
    masses = StrutMasses(30.0, 0.0, 0.0, 10.0, 1400.0)
    with_struts = replace(reference, strut_masses=masses)
    heavier = DRIVES.effect(motion, with_struts, gains).current_a - DRIVES.effect(motion, reference, gains).current_a
    # By virtual work: when all struts shrink by dL the platform rises by dL / cos, and each strut's masses by their part.
    down, length = -struts.unit[:, :, 2], struts.length_mm
    rise = 1 / down  # of the platform joints
    across = rise - down  # of a point at the platform joint, beyond the motion along the strut
    rod = 30.0 * rise / 2
    screw = 10.0 * (down + across * (length - 700.0) / length)
    assert np.allclose(heavier, 9.81 * (rod + screw) / 1000, rtol=1e-4)


def test_friction_turns_over_on_a_short_way_after_a_reversal(reference):
    step = TURNED_OVER_MM / 5
    travel = np.concatenate([np.arange(0, 2, step), np.arange(2, 0, -step)])
    motion = all_struts(reference, travel, np.arange(len(travel)) * 0.1)
    way = driven_directions(motion, reference)
    turn = int(np.argmax(travel))
    assert np.allclose(way[: turn + 1], 1.0)
    assert np.allclose(way[turn : turn + 6, 0], [1.0, 0.6, 0.2, -0.2, -0.6, -1.0], atol=1e-6)
    assert np.allclose(way[turn + 6 :], -1.0)


def test_what_hangs_on_the_load_is_its_derivative(reference, rng):
    machine = random_machine(reference, reference.hexapod.rotation, rng)
    motion = random_run(rng)
    load = rng.normal(0, 800, (len(motion), 6))
    ends = [DRIVES.effect(replace(motion, load_n=load + step), machine, VALUES).current_a for step in (0.01, -0.01)]
    per_load = DRIVES.current_per_load(replace(motion, load_n=load), machine, VALUES)
    away = np.abs(load) > 0.02
    assert np.allclose(((ends[0] - ends[1]) / 0.02)[away], per_load[away], rtol=1e-6)


def test_it_moves_nothing(reference):
    effect = DRIVES.effect(run((0, 0, -1008), (10, 0)), reference, VALUES)
    moved = (effect.strut_mm, effect.base_joint_mm, effect.platform_joint_mm, effect.tool_tip_mm, effect.reading_mm)
    assert moved == (None,) * 5
    assert DRIVES.of_currents


def test_a_machine_without_masses_is_told_what_its_file_lacks(reference):
    with pytest.raises(ModelError, match=r"drive-friction needs .* has no `masses`; add `masses"):
        DRIVES.parameters(replace(reference, masses=None))


def test_poses_without_time_have_no_speed(reference):
    motion = replace(run((0, 0, -1008), (10, 0)), time_s=None, logged=currents(np.zeros((202, 6))))
    with pytest.raises(ModelError, match="drive-friction needs time"):
        DRIVES.effect(motion, reference, VALUES)
