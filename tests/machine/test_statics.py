"""Statics against equilibrium of the whole, potential energy, closed forms and limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import KinematicsError
from dbbstation.machine.geometry import Compliance, Frames, Masses, Rotation, StrutMasses
from dbbstation.machine.kinematics import forward, inverse
from dbbstation.machine.statics import (
    base_loads,
    motor_loads,
    platform_weight,
    stretch_mm,
    strut_tensions,
    transverse_load,
    transverse_pull,
)

G = 9.81
PLATFORM = Masses(platform_kg=380.0, centre_of_gravity_above_tip_mm=470.0)
STRUT = StrutMasses(strut_kg=25.0, motor_kg=20.0, motor_length_mm=300.0, screw_kg=12.0, screw_length_mm=1500.0)
WEIGHTLESS = StrutMasses(strut_kg=0.0, motor_kg=0.0, motor_length_mm=300.0)


@pytest.fixture(params=list(Rotation))
def hexapod(request, reference, rng):
    same = replace(reference.hexapod, rotation=request.param)
    return same.moved(rng.normal(0, 20, (6, 3)), rng.normal(0, 20, (6, 3)))


@pytest.fixture
def frames(hexapod, rng):
    poses = rng.uniform([-150, -150, -1180, -12, -12, -4], [150, 150, -900, 12, 12, 4], (12, 6))
    return Frames.from_poses(poses, hexapod.rotation)


def tensions(hexapod, frames, platform=PLATFORM, strut=None):
    struts = inverse(hexapod, frames)
    load = platform_weight(frames, platform)
    if strut is not None:
        load += transverse_load(struts, transverse_pull(struts, strut))
    return strut_tensions(struts, load)


def points_of_mass(hexapod, frames, platform, strut):
    """Every mass [kg] with its centre in the machine frame, shape (n, 3) [mm]: platform, rods, motors, screws."""
    yield (
        platform.platform_kg,
        frames.position_mm + frames.rotation @ [0, 0, platform.centre_of_gravity_above_tip_mm],
    )
    for i in range(6):
        base = hexapod.base_joints_mm[i]
        end = frames.position_mm + frames.rotation @ hexapod.platform_joints_mm[i]
        along = (end - base) / np.linalg.norm(end - base, axis=1, keepdims=True)
        yield strut.strut_kg, (base + end) / 2
        yield strut.motor_kg, base - along * strut.motor_length_mm / 2
        yield strut.screw_kg, end - along * strut.screw_length_mm / 2


def energy_n_mm(hexapod, frames, platform, strut):
    return sum(G * mass * centre[:, 2] for mass, centre in points_of_mass(hexapod, frames, platform, strut))


@pytest.mark.parametrize("strut", [WEIGHTLESS, STRUT])
def test_the_base_carries_all_weights_and_their_moments_about_any_point(hexapod, frames, strut, rng):
    struts = inverse(hexapod, frames)
    loads = base_loads(struts, tensions(hexapod, frames, strut=strut), strut)
    weight = G * (PLATFORM.platform_kg + 6 * (strut.strut_kg + strut.motor_kg + strut.screw_kg))
    assert np.allclose(loads.sum(axis=1), [0, 0, -weight], atol=1e-7)
    for point in rng.uniform(-2000, 2000, (3, 3)):
        carried = np.cross(hexapod.base_joints_mm - point, loads).sum(axis=1)
        acting = sum(
            np.cross(centre - point, [0, 0, -G * mass])
            for mass, centre in points_of_mass(hexapod, frames, PLATFORM, strut)
        )
        assert np.allclose(carried, acting, atol=1e-4)


@pytest.mark.parametrize("strut", [WEIGHTLESS, STRUT])
def test_a_motor_feels_what_the_potential_energy_gains_by_its_stroke(hexapod, frames, strut):
    struts = inverse(hexapod, frames)
    loads = motor_loads(struts, tensions(hexapod, frames, strut=strut), strut)
    h = 1e-2
    for i in range(6):
        stroke = h * np.eye(6)[i]
        ends = [
            energy_n_mm(hexapod, forward(hexapod, struts.length_mm + sign * stroke, frames), PLATFORM, strut)
            for sign in (1, -1)
        ]
        assert np.allclose(loads[:, i], (ends[1] - ends[0]) / (2 * h), rtol=1e-5, atol=1e-2)


def test_the_platform_moved_a_little_does_the_work_of_its_struts(hexapod, frames, rng):
    strut_force = tensions(hexapod, frames)
    small = 1e-4
    shift = rng.normal(0, small, (len(frames), 3))
    moved = Frames(frames.position_mm + shift, frames.rotation)
    stretched = inverse(hexapod, moved).length_mm - inverse(hexapod, frames).length_mm
    work = (strut_force * stretched).sum(axis=1)
    assert np.allclose(work, -G * PLATFORM.platform_kg * shift[:, 2], atol=1e-4)


def test_six_equal_forces_where_all_is_symmetric(reference):
    frames = Frames(np.array([[0.0, 0.0, -1008.0]]), np.eye(3)[None])
    slope = -inverse(reference.hexapod, frames).unit[0, 0, 2]
    assert np.allclose(tensions(reference.hexapod, frames), G * PLATFORM.platform_kg / (6 * slope))
    strut_force = tensions(reference.hexapod, frames, strut=STRUT)
    assert np.allclose(strut_force, strut_force[0, 0])


def test_struts_that_weigh_nothing_do_nothing(hexapod, frames):
    struts = inverse(hexapod, frames)
    plain = tensions(hexapod, frames)
    assert np.allclose(tensions(hexapod, frames, strut=WEIGHTLESS), plain, atol=1e-9)
    assert np.allclose(motor_loads(struts, plain, WEIGHTLESS), motor_loads(struts, plain))
    assert np.allclose(base_loads(struts, plain, WEIGHTLESS), base_loads(struts, plain))
    soft = Compliance(1e-5)
    assert np.allclose(stretch_mm(struts, soft, plain, WEIGHTLESS), stretch_mm(struts, soft, plain))


def test_a_screw_without_length_is_a_weight_at_the_platform_joint(hexapod, frames):
    end_weight = StrutMasses(0.0, 0.0, 0.0, screw_kg=15.0, screw_length_mm=0.0)
    struts = inverse(hexapod, frames)
    loads = motor_loads(struts, tensions(hexapod, frames, strut=end_weight), end_weight)
    hung = np.broadcast_to([0.0, 0.0, -15.0 * G], struts.unit.shape)
    expected = strut_tensions(struts, platform_weight(frames, PLATFORM) + transverse_load(struts, hung))
    assert np.allclose(loads, expected, atol=1e-8)


def test_transverse_pull_has_the_published_magnitude_and_hangs_down(hexapod, frames):
    # [GRAV eq 2]: m_m g sin(gamma) (L_m / 2) / L_s - m_s g sin(gamma) / 2, gamma between strut and Z axis.
    struts = inverse(hexapod, frames)
    pull = transverse_pull(struts, replace(STRUT, screw_kg=0.0))
    sine = np.sqrt(1 - struts.unit[:, :, 2] ** 2)
    published = 20.0 * G * sine * 150.0 / struts.length_mm - 25.0 * G * sine / 2
    assert np.allclose(np.linalg.norm(pull, axis=2), np.abs(published))
    assert np.allclose((pull * struts.unit).sum(axis=2), 0, atol=1e-9)
    # The rod's half outweighs the motor here, so the platform is pulled down by it.
    assert (pull[:, :, 2] < 0).all()


@pytest.mark.parametrize(("growing", "screw_kg"), [(0.0, 0.0), (0.9, 0.0), (0.9, 12.0), (1.0, 12.0)])
def test_a_strut_stretches_by_what_hangs_below_each_of_its_sections(hexapod, frames, growing, screw_kg):
    strut, soft = replace(STRUT, screw_kg=screw_kg), Compliance(9e-6, growing)
    struts = inverse(hexapod, frames)
    tension = tensions(hexapod, frames, strut=strut)
    axial = -G * struts.unit[:, :, 2]
    # Midpoint sums over a thousand sections of the part that grows; the rest carries what the motor holds.
    share = (np.arange(1000) + 0.5) / 1000
    below_kg = strut.strut_kg * (1 - share) + (
        screw_kg * struts.length_mm[:, :, None] * (1 - share) / strut.screw_length_mm
    )
    per_section = 9e-6 * growing * struts.length_mm / 1000.0 / 1000
    expected = (per_section[:, :, None] * (tension[:, :, None] + axial[:, :, None] * below_kg)).sum(axis=2)
    expected += 9e-6 * (1 - growing) * motor_loads(struts, tension, strut)
    assert np.allclose(stretch_mm(struts, soft, tension, strut), expected, rtol=1e-9)


def test_a_platform_that_its_struts_cannot_hold_is_refused(reference):
    # Six parallel struts hold nothing against a sideways push.
    same = replace(reference.hexapod, platform_joints_mm=reference.hexapod.base_joints_mm)
    frames = Frames(np.array([[0.0, 0.0, -1008.0]]), np.eye(3)[None])
    with pytest.raises(KinematicsError, match="pose 1: the struts cannot hold"):
        tensions(same, frames)
