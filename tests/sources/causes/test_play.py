"""Play under load: against a simulation of two stops, a load and friction, and against what forces do in circles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.laws.play import followed, leaning
from dbbstation.machine.geometry import Compliance, Frames, StrutMasses
from dbbstation.machine.kinematics import forward, inverse
from dbbstation.model.compensation import compensated
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.causes.backlash import Backlash
from dbbstation.sources.causes.gravity import Gravity
from dbbstation.sources.causes.play import Play
from dbbstation.sources.contract import Fitted
from tests.sources.runs import BORES_MM, JIG_TESTS, LEVELS_MM, random_machine, random_run, run

PLAY = Play()


def play_um(machine, motion, widths_um, friction_n=0.0):
    return 1e3 * PLAY.effect(motion, machine, np.array([*np.broadcast_to(widths_um, 6), friction_n])).strut_mm


def jig_run(test, **given):
    bore, level, a, b = JIG_TESTS[test]
    return run((*BORES_MM[bore], LEVELS_MM[level]), (a, b), **given)


def changes_sign(machine, motion):
    stretch = Gravity().effect(motion, machine, np.ones(1)).strut_mm[motion.kept]
    return (stretch.min(axis=0) < 0) & (stretch.max(axis=0) > 0)


def simulated(travel, tension, width, friction, stiffness=3e5):
    """A body between two stiff stops of the drive, pulled by the load, held by friction; it creeps as force allows."""
    y, places = travel[0] + width / 2 * np.sign(tension[0]), np.empty_like(travel)
    for k, (x, pull) in enumerate(zip(travel, tension, strict=True)):
        beyond = y - x
        stop = -stiffness * (max(beyond - width / 2, 0.0) + min(beyond + width / 2, 0.0))
        net = pull + stop
        y += 0.5 / stiffness * np.sign(net) * max(abs(net) - friction, 0.0)
        places[k] = y - x
    return places


@pytest.mark.parametrize("friction", [0.0, 60.0, 500.0])
def test_two_stops_a_load_and_friction(friction):
    t = np.linspace(0, 2 * np.pi, 400_001)
    travel, tension = 0.15 * np.sin(2 * t - 0.4), 20.0 + 300.0 * np.cos(t)
    width = 0.02
    begins = leaning(travel[:, None])
    place, _, _ = followed(travel[:, None], np.array([width]), begins, tension[:, None], friction)
    expected = simulated(travel, tension, width, friction)
    # The simulated body dips into its stops by force over stiffness, and needs time to cross the play.
    dip = (320.0 + friction) / 3e5
    far = np.arange(len(t)) > 20_000  # where it began is forgotten
    off = np.abs(place[:, 0] - expected)[far]
    assert np.mean(off > 1.2 * dip) < 0.02
    assert off.max() < width + 2 * dip
    assert np.ptp(expected[far]) > width
    assert np.ptp(place[far]) == width


def test_struts_under_load_do_not_notice_their_reversals(reference):
    for test in "afk":
        motion = jig_run(test)
        assert not changes_sign(reference, motion).any()
        assert np.allclose(play_um(reference, motion, 4.0, 50.0), 2.0)


def test_there_are_steps_in_twelve_of_the_fifteen_circles(reference):
    stepped = [
        bool(np.ptp(play_um(reference, motion, 4.0)[motion.kept], axis=0).any()) for motion in map(jig_run, JIG_TESTS)
    ]
    signs = [bool(changes_sign(reference, jig_run(test)).any()) for test in JIG_TESTS]
    assert sum(stepped) == 12
    assert stepped == signs


def test_steps_sit_where_the_force_changes_sign_whatever_the_direction(reference):
    there, back = (jig_run("c", clockwise=c, step_deg=1.0) for c in (False, True))
    ccw, cw = (play_um(reference, m, 4.0)[m.kept] for m in (there, back))
    assert np.array_equal(ccw, np.roll(cw[::-1], 1, axis=0))
    tension = Gravity().effect(there, reference, np.ones(1)).strut_mm[there.kept]
    assert np.array_equal(ccw, 2.0 * np.sign(tension))


def test_with_friction_the_drive_takes_a_strut_across_before_its_force_turns(reference):
    seen = 0
    for test in "bchilm":
        motion = jig_run(test, step_deg=0.5)
        length = inverse(reference.hexapod, Frames.from_poses(motion.poses, reference.hexapod.rotation)).length_mm
        weight = 400.0 * 9.81
        stiff = replace(reference, compliance=Compliance(1e-6, growing_share=0.0))
        tension_n = 1e3 * Gravity().effect(motion, stiff, np.ones(1)).strut_mm * 1e3
        assert np.abs(tension_n).max() < 2 * weight
        free, held = play_um(reference, motion, 4.0), play_um(reference, motion, 4.0, 100.0)
        for i in range(6):
            for k in np.flatnonzero(np.diff(free[:, i])) + 1:
                before = np.arange(k - 45, k + 10)
                if before[0] < 0 or before[-1] >= len(motion):
                    continue
                way = np.diff(length[before, i])
                if np.any(way * way[0] < 0) or np.sign(way[0]) != -np.sign(free[k, i]):
                    continue
                holds = before[np.abs(tension_n[before, i]) <= 100.0]
                steps = before[1:][np.abs(np.diff(held[before, i])) > 1.0]
                assert abs(int(steps[0]) - int(holds[0])) <= 1
                assert steps[0] < k
                seen += 1
    assert seen > 10


def test_with_friction_above_all_forces_it_is_backlash(reference, rng):
    motion, um = random_run(rng), np.array([3.0, 5.0, -2.0, 800.0, 40.0, 0.0])
    lag = Backlash().effect(motion, reference, um).strut_mm
    assert np.allclose(PLAY.effect(motion, reference, np.append(um, 1e6)).strut_mm, lag, rtol=0, atol=1e-12)


def test_without_friction_it_has_no_history(reference, rng):
    motion = random_run(rng)
    order = rng.permutation(len(motion))
    shuffled = replace(motion, poses=motion.poses[order], time_s=motion.time_s[order])
    assert np.allclose(play_um(reference, shuffled, 4.0), play_um(reference, motion, 4.0)[order])


def test_the_force_is_what_the_drive_holds(reference, rng):
    machine = random_machine(reference, reference.hexapod.rotation, rng)
    motion = random_run(rng, 60)
    frames = Frames.from_poses(motion.poses, machine.hexapod.rotation)
    length = inverse(machine.hexapod, frames).length_mm
    strut: StrutMasses = machine.strut_masses

    def energy(at):
        base = machine.hexapod.base_joints_mm
        end = at.position_mm[:, None] + np.einsum("nij,kj->nki", at.rotation, machine.hexapod.platform_joints_mm)
        along = (end - base) / np.linalg.norm(end - base, axis=2, keepdims=True)
        heights = (
            strut.strut_kg * (base + end) / 2
            + strut.motor_kg * (base - along * strut.motor_length_mm / 2)
            + strut.screw_kg * (end - along * strut.screw_length_mm / 2)
        )[:, :, 2].sum(axis=1)
        centre = at.position_mm + at.rotation[:, :, 2] * machine.masses.centre_of_gravity_above_tip_mm
        return 9.81 * (heights + machine.masses.platform_kg * centre[:, 2])

    for i in range(6):
        h = 1e-2 * np.eye(6)[i]
        held = (
            energy(forward(machine.hexapod, length - h, frames)) - energy(forward(machine.hexapod, length + h, frames))
        ) / 2e-2
        clear = np.abs(held) > 1.0
        assert np.array_equal(play_um(machine, motion, 4.0)[clear, i], 2.0 * np.sign(held[clear]))


def test_it_is_compensated(reference):
    model = MachineModel(reference, (Fitted(PLAY, np.array([4.0, 3.0, 5.0, 2.0, 1.0, 6.0, 100.0])),))
    wanted = replace(jig_run("m"), kept=slice(None))
    commanded = compensated(model, wanted)
    assert np.abs(commanded - wanted.poses)[:, :3].max() > 5e-4
    assert np.allclose(
        model.actual_poses(replace(wanted, poses=commanded, straight=True)), wanted.poses, rtol=0, atol=1e-8
    )


def test_a_machine_without_masses_and_single_poses_are_refused(reference, rng):
    bare, motion = replace(reference, masses=None), random_run(rng)
    with pytest.raises(ModelError, match=r"play needs .* has no `masses`"):
        PLAY.parameters(bare)
    with pytest.raises(ModelError, match=r"play needs .* has no `masses`"):
        PLAY.effect(motion, bare, np.ones(7))
    with pytest.raises(ModelError, match="play needs path"):
        PLAY.effect(replace(motion, is_path=False), reference, np.ones(7))


def test_a_shaken_strut_lies_where_its_shaken_forces_put_it_on_the_average(reference, rng):
    """Against drawn forces: at either end of the play as load and shaking together pull or push; without shaking, `PLAY`."""
    shaken, motion = PLAY.other_laws()[0], random_run(rng, 40)
    um, stiff = np.array([3.0, 5.0, -2.0, 4.0, 8.0, 1.0]), replace(reference, strut_masses=None)
    stiff = replace(stiff, compliance=Compliance(1e-6, growing_share=0.0))
    tension_n = 1e6 * Gravity().effect(motion, stiff, np.ones(1)).strut_mm
    drawn = np.sign(tension_n + 120.0 * rng.standard_normal((20_000, 1, 1))).mean(axis=0)
    found = 1e3 * shaken.effect(motion, stiff, np.append(um, 120.0)).strut_mm
    assert np.abs(found / (um / 2) - drawn).max() < 5.0 / np.sqrt(20_000)
    still = 1e3 * shaken.effect(motion, stiff, np.append(um, 0.0)).strut_mm
    clear = np.abs(tension_n) > 5.0
    assert np.allclose(still[clear], 1e3 * PLAY.effect(motion, stiff, np.append(um, 0.0)).strut_mm[clear], atol=1e-5)


def test_a_shaken_play_answers_to_its_widths_and_to_the_shaking(reference, rng):
    shaken, motion = PLAY.other_laws()[0], random_run(rng, 60)
    values = np.array([3.0, 5.0, -2.0, 4.0, 8.0, 1.0, 150.0])
    slopes = shaken.derivative(motion, reference, values).strut_mm
    for k, step in enumerate(np.diag([0.1] * 6 + [0.5])):
        ends = (shaken.effect(motion, reference, values + sign * step).strut_mm for sign in (1.0, -1.0))
        assert slopes[:, :, k] == pytest.approx((next(ends) - next(ends)) / (2.0 * step[k]), rel=1e-4, abs=1e-9)
