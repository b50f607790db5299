"""Centre of gravity, weights of struts, yielding frame: against potential energy, springs and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.machine.geometry import Compliance, Frames, Masses, Rotation, StrutMasses
from dbbstation.machine.kinematics import forward, inverse
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.base_compliance import BaseCompliance
from dbbstation.sources.causes.cog_shift import CogShift
from dbbstation.sources.causes.gravity import Gravity
from dbbstation.sources.causes.strut_weight import StrutWeight
from dbbstation.sources.contract import Effect, Fitted
from tests.sources.runs import concealed, jig_runs, random_machine, random_run, run

GRAVITY, COG, WEIGHT, FRAME = Gravity(), CogShift(), StrutWeight(), BaseCompliance()


@pytest.fixture(params=list(Rotation))
def machine(request, reference, rng):
    return random_machine(reference, request.param, rng)


def by_stroke(machine, motion, energy_n_mm, h=1e-2):
    """Force that each motor holds, shape (n, 6) [N]: what the potential energy gains by shortening its strut."""
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    length = inverse(machine.hexapod, frames).length_mm
    columns = []
    for stroke in h * np.eye(6):
        ends = [energy_n_mm(forward(machine.hexapod, length + sign * stroke, frames)) for sign in (-1, 1)]
        columns.append((ends[0] - ends[1]) / (2 * h))
    return np.column_stack(columns)


def test_shift_along_the_axis_is_another_height_of_the_centre(machine, rng):
    motion = random_run(rng)
    design = machine.compliance.at_1000mm_mm_per_n
    as_gravity = np.array([design / 1e-6])
    masses = machine.masses
    higher = replace(machine, masses=replace(masses, centre_of_gravity_above_tip_mm=650.0))
    gained = GRAVITY.effect(motion, higher, as_gravity).strut_mm - GRAVITY.effect(motion, machine, as_gravity).strut_mm
    shift = np.array([0.0, 0.0, 650.0 - masses.centre_of_gravity_above_tip_mm])
    assert np.allclose(COG.effect(motion, machine, shift).strut_mm, gained, atol=1e-12)


def test_shift_across_the_axis_does_the_work_of_a_lifted_weight(machine, rng):
    stiff = replace(machine, compliance=Compliance(1e-6, growing_share=0.0))
    motion = random_run(rng, 40)
    shift = np.array([12.0, -23.0, 8.0])

    def energy(frames):
        return machine.masses.platform_kg * 9.81 * (frames.rotation @ shift)[:, 2]

    expected = 1e-6 * by_stroke(stiff, motion, energy)
    assert np.allclose(COG.effect(motion, stiff, shift).strut_mm, expected, rtol=1e-4, atol=1e-8)


def test_weights_of_rod_motor_and_screw_do_the_work_of_their_centres(machine, rng):
    strut = machine.strut_masses
    stiff = replace(machine, compliance=Compliance(1e-6, growing_share=0.0))
    motion = random_run(rng, 40)

    def energy(frames):
        base = machine.hexapod.base_joints_mm
        end = frames.position_mm[:, None] + np.einsum(
            "nij,kj->nki", frames.rotation, machine.hexapod.platform_joints_mm
        )
        along = (end - base) / np.linalg.norm(end - base, axis=2, keepdims=True)
        heights = (
            strut.strut_kg * (base + end) / 2
            + strut.motor_kg * (base - along * strut.motor_length_mm / 2)
            + strut.screw_kg * (end - along * strut.screw_length_mm / 2)
        )
        return 9.81 * heights[:, :, 2].sum(axis=1)

    masses_kg = np.array([strut.strut_kg, strut.motor_kg, strut.screw_kg])
    expected = 1e-6 * by_stroke(stiff, motion, energy)
    assert np.allclose(WEIGHT.effect(motion, stiff, masses_kg).strut_mm, expected, rtol=1e-4, atol=1e-8)


def test_parts_of_a_strut_are_asked_for_where_it_is_known_where_they_act(reference):
    def names(masses):
        return [p.name for p in WEIGHT.parameters(replace(reference, strut_masses=masses))]

    assert names(None) == ["strut_kg"]
    assert names(StrutMasses(20.0, 15.0, 300.0)) == ["strut_kg", "motor_kg"]
    assert names(StrutMasses(20.0, 0.0, 0.0, 9.0, 1400.0)) == ["strut_kg", "screw_kg"]
    stated = WEIGHT.parameters(replace(reference, strut_masses=StrutMasses(20.0, 15.0, 300.0)))
    assert [p.plausible for p in stated] == [20.0, 15.0]


def test_what_circles_see_multiplied_says_by_what(reference):
    soft = replace(reference, compliance=Compliance(1.25e-5))
    for source in (COG, WEIGHT):
        assert "12.5 µm/kN" in source.parameters(soft)[0].meaning


def test_a_frame_equally_soft_all_ways_is_a_strut_softer_at_every_length(machine):
    """F = T u moves the joint by c T u, and u dQ = c T is what a strut longer by c T does."""
    light = replace(machine, strut_masses=None, compliance=Compliance(1e-5, growing_share=0.0))
    motion = run((40, -30, -1050), (6, -8))
    small = 0.1  # [µm/kN], so that nothing of second order shows
    frame = MachineModel(light, (Fitted(FRAME, np.full(2, small)),))
    strut = MachineModel(light, (Fitted(GRAVITY, np.array([small])),))
    nominal = MachineModel(light).bar(motion).length_mm
    by_frame, by_strut = (model.bar(motion).length_mm - nominal for model in (frame, strut))
    assert np.abs(by_strut).max() > 1e-5
    assert np.allclose(by_frame, by_strut, rtol=1e-4)


@pytest.mark.parametrize("with_struts", [False, True])
def test_springs_under_the_joints_carry_all_that_hangs_there(machine, rng, with_struts):
    if not with_struts:
        machine = replace(machine, strut_masses=None)
    strut = machine.strut_masses or StrutMasses(0, 0, 0)
    shift = FRAME.effect(random_run(rng), machine, np.array([4.0, 2.0])).base_joint_mm
    force_n = shift / [4e-6, 4e-6, 2e-6]
    weight = 9.81 * (machine.masses.platform_kg + 6 * (strut.strut_kg + strut.motor_kg + strut.screw_kg))
    assert np.allclose(force_n.sum(axis=1), [0, 0, -weight], atol=1e-6)


def test_weight_of_rods_and_yielding_frame_look_like_gravity(reference):
    runs = jig_runs(step_deg=5.0)

    def left(source):
        values = np.ones(len(source.parameters(reference)))
        _, remains, _ = concealed(reference, runs, lambda m: source.derivative(m, reference, values))
        return remains.sum(axis=1)

    gravity = left(GRAVITY)

    def alike(other):
        return (gravity @ other) ** 2 / (gravity @ gravity) / (other @ other)

    # Rods of 25 kg put half of their weight on the platform: another 75 of 400 kg, in nearly the same places.
    assert alike(left(WEIGHT)) > 0.999
    assert 25.0 * (left(WEIGHT) @ gravity) / (gravity @ gravity) / 10.0 == pytest.approx(75 / 400, abs=0.02)
    assert 0.9 < alike(left(FRAME)) < 0.99
    assert alike(left(COG)) < 0.5


@pytest.mark.parametrize("source", [COG, FRAME], ids=["cog", "frame"])
def test_a_machine_without_masses_is_told_what_its_file_lacks(reference, rng, source):
    bare = replace(reference, masses=None)
    lacks = pytest.raises(ModelError, match=f"{source.name} needs .* has no `masses`")
    with lacks:
        source.parameters(bare)
    with lacks:
        source.effect(random_run(rng), bare, np.ones(3))


def test_a_weightless_platform_and_weightless_struts_bend_nothing(reference, rng):
    motion = random_run(rng)
    empty = replace(reference, masses=Masses(0.0, 500.0), strut_masses=StrutMasses(0.0, 0.0, 300.0))

    def size(effect: Effect):
        return max(np.abs(a).max() for a in (effect.strut_mm, effect.base_joint_mm) if a is not None)

    assert size(GRAVITY.effect(motion, empty, np.array([10.0]))) == 0
    assert size(COG.effect(motion, empty, np.full(3, 20.0))) == 0
    assert size(FRAME.effect(motion, empty, np.full(2, 5.0))) == 0
    assert size(WEIGHT.effect(motion, empty, np.zeros(2))) == 0
