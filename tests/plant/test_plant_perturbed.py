"""Mechanisms off their law: by the factors that they are told, in the forms that they are told, else as before."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from scipy.integrate import quad

from tests.plant.blind.listed import LISTED, SINGLE
from tests.plant.blind.perturb import DEVIATIONS, drawn_perturbation
from tests.plant.linear import LinearSession
from tests.plant.machine import reference_machine
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.balls import MountingScatter
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.joints import JointFriction
from tests.plant.mechanisms.perturbed import AcrossPlate, AlongStrut, ByDirection, ByLoad, FromStrutToStrut, Perturbed
from tests.plant.mechanisms.perturbed_forms import (
    BowedScrewLead,
    GradualBacklash,
    HarmonicBarCyclic,
    HarmonicScrewCyclic,
    UnevenJointFriction,
)
from tests.plant.mechanisms.screw import ScrewCyclic, ScrewLead
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.mechanisms.set_up import BarCyclic
from tests.plant.mechanisms.thermal import JigThermal
from tests.plant.mechanisms.warming import SeveralBodies, stretched
from tests.plant.plan import subset, table_ii_plan
from tests.plant.run import Motion, Scene
from tests.plant.session import record, scene_of
from tests.plant.simulate import simulate, true_platform
from tests.plant.test_plant_motion import one_motion

NOTHING = (0.0,) * 6
MOTION = one_motion(np.arange(0.0, 80.0, 0.02))


@pytest.mark.parametrize(
    "perturbed",
    [
        FromStrutToStrut(Gravity(), NOTHING),
        ByLoad(Gravity(), 0.0),
        AlongStrut(Backlash(), 0.0, (100.0,) * 6, NOTHING),
        ByDirection(ServoLag(), NOTHING),
        AcrossPlate(JigThermal(), 0.0, 30.0),
        BowedScrewLead(),
        HarmonicScrewCyclic(),
        HarmonicBarCyclic(),
        UnevenJointFriction(),
    ],
)
def test_without_a_deviation_the_law_holds(perturbed) -> None:
    law = perturbed.law if isinstance(perturbed, Perturbed) else type(perturbed).__bases__[0]()
    assert (perturbed.name, perturbed.listed) == (law.name, law.listed)
    motion = one_motion(np.arange(0.0, 80.0, 0.2))
    np.testing.assert_allclose(simulate(motion, [perturbed]).length_mm, simulate(motion, [law]).length_mm, atol=1e-9)


def test_struts_differ_by_their_factors() -> None:
    law, factors = Gravity(), (0.1, -0.1, 0.02, 0.0, 0.3, -0.2)
    platform = true_platform(MOTION, [])
    ratio = FromStrutToStrut(law, factors).lengthening_mm(MOTION, platform) / law.lengthening_mm(MOTION, platform)
    np.testing.assert_allclose(ratio, np.broadcast_to(1.0 + np.array(factors), ratio.shape), rtol=1e-12)


def test_contacts_stiffen_under_load() -> None:
    law = Gravity()
    platform = true_platform(MOTION, [])
    stretch_mm = ByLoad(law, 0.2).lengthening_mm(MOTION, platform)
    # At 1 kN the compliance is the law's, at nothing a fifth more, under a great load a fifth less.
    ratio, load_n = stretch_mm / law.lengthening_mm(MOTION, platform), np.abs(platform.tension_n)
    assert np.interp(1000.0, np.sort(load_n.ravel()), ratio.ravel()[np.argsort(load_n.ravel())]) == pytest.approx(
        1.0, abs=0.002
    )
    order = np.argsort(load_n.ravel())
    assert (np.diff(ratio.ravel()[order]) <= 1e-12).all()
    assert (ratio > 0.8).all()
    assert (ratio < 1.2).all()


def test_no_load_is_known_in_the_drives() -> None:
    with pytest.raises(ValueError, match="backlash acts in the drives"):
        true_platform(MOTION, [ByLoad(Backlash(), 0.1)])


def test_along_a_strut_the_deviation_has_the_stated_root_mean_square() -> None:
    perturbed = AlongStrut(Gravity(), 0.2, (40.0,) * 6, (0.0, 60.0, 120.0, 180.0, 240.0, 300.0))
    poses = np.zeros((4001, 6))
    poses[:, 2] = np.linspace(-1100.0, -900.0, 4001)
    motion = Motion(Scene(reference_machine(), table_ii_plan(1), ()), np.arange(4001.0), poses)
    off = perturbed.factor(motion, None)[:, 0] - 1.0
    # Whole waves of the first strut, evenly over its length.
    length_mm = motion.commanded_mm[:, 0]
    whole_mm = np.arange(length_mm.min(), length_mm.min() + 40.0 * ((np.ptp(length_mm)) // 40.0), 0.01)
    at = np.interp(whole_mm, np.sort(length_mm), off[np.argsort(length_mm)])
    assert np.sqrt(np.mean(at**2)) == pytest.approx(0.2, rel=1e-3)


def test_growing_struts_have_more_and_shrinking_ones_less() -> None:
    whole_mm, off_mm = (
        item.driven_mm(MOTION, MOTION.commanded_mm) for item in (ServoLag(), ByDirection(ServoLag(), (0.2,) * 6))
    )
    moving = np.abs(MOTION.strut_speed_mm_s) > 0.05
    expected_mm = whole_mm * (1.0 + 0.2 * np.sign(MOTION.strut_speed_mm_s))
    assert np.mean(np.abs(off_mm - expected_mm)[moving] < 1e-12) > 0.99


def test_a_plate_grows_more_on_one_side() -> None:
    plan = table_ii_plan(1)
    scene = scene_of(plan)
    law, perturbed = JigThermal(), AcrossPlate(JigThermal(), 0.1, 90.0)
    for slot in scene.slots:
        motion = Motion(scene, np.array([slot.start_s]), slot.path.poses(np.zeros(1)), slot)
        y_mm = plan.ball(slot.test.ball).centre_mm[1]
        whole, off = (item.fixed_ball_mm(motion, None) for item in (law, perturbed))
        np.testing.assert_allclose(off, whole * (1.0 + 0.1 * y_mm / 150.0), rtol=1e-12)


def test_a_gradual_reversal_ends_where_a_sharp_one_does() -> None:
    gap_um, transit_um = (4.0,) * 6, (60.0,) * 6
    travel_mm = np.concatenate([np.arange(0.0, 1.0, 0.001), np.arange(1.0, 0.0, -0.001)])
    driven_mm = np.tile(travel_mm[:, None], (1, 6))
    sharp = Backlash(gap_um).driven_mm(MOTION, driven_mm)[:, 0]
    gradual = GradualBacklash(gap_um, transit_um).driven_mm(MOTION, driven_mm)[:, 0]
    since_turn_mm = 1.0 - travel_mm[1000:]
    settled = since_turn_mm > 0.061
    np.testing.assert_allclose(gradual[1000:][settled], sharp[1000:][settled], atol=1e-12)
    # Thirds of the gap are crossed, evenly with travel, over 0.3, 0.7 and 1.0 of the transit.
    shares = np.mean([np.clip(since_turn_mm / (share * 0.06), 0.0, 1.0) for share in (0.3, 0.7, 1.0)], axis=0)
    np.testing.assert_allclose(1e3 * gradual[1000:], -2.0 + 4.0 * shares, atol=1e-9)


def test_a_bowed_lead_is_a_parabola() -> None:
    lead = BowedScrewLead((40.0,) * 6, 700.0, (0.1,) * 6, 150.0)
    driven_mm = np.tile(np.array([[550.0], [700.0], [850.0]]), (1, 6))
    np.testing.assert_allclose(1e3 * lead.driven_mm(MOTION, driven_mm)[:, 0], [-6.0 * 0.9, 0.0, 6.0 * 1.1], atol=1e-12)


@pytest.mark.parametrize("harmonic", [0.1, 0.3])
def test_harmonics_are_as_large_as_told(harmonic: float) -> None:
    length_mm = np.tile(np.arange(700.0, 720.0, 0.05)[:, None], (1, 6))  # two turns of a lead of 10 mm
    screw = HarmonicScrewCyclic((2.0,) * 6, NOTHING, (harmonic,) * 6, (90.0,) * 6)
    spectrum = np.abs(np.fft.rfft(1e3 * screw.driven_mm(MOTION, length_mm)[:, 0])) / 200.0
    np.testing.assert_allclose(spectrum[[2, 4]], [2.0, 2.0 * harmonic], atol=1e-9)
    assert np.abs(np.delete(spectrum, [2, 4])).max() < 1e-9
    reading_mm = 150.0 + np.arange(0.0, 0.04, 0.0001)  # two periods of 20 µm
    bar = HarmonicBarCyclic(0.5, 20.0, 0.0, harmonic, 30.0)
    spectrum = np.abs(np.fft.rfft(1e3 * bar.reading_mm(MOTION, None, reading_mm))) / 200.0
    np.testing.assert_allclose(spectrum[[2, 4]], [0.5, 0.5 * harmonic], atol=1e-9)


def test_joints_rub_more_at_some_angles_and_one_way() -> None:
    angle_rad = np.tile(
        np.radians(np.concatenate([np.arange(0.0, 20.0, 0.01), np.arange(20.0, 0.0, -0.01)]))[:, None], (1, 2)
    )
    uneven = UnevenJointFriction(deviation=0.2, period_deg=10.0, phase_deg=0.0, asymmetry=0.1)
    ratio = uneven._wound(angle_rad)[5:, 0] / JointFriction()._wound(angle_rad)[5:, 0]
    growing, shrinking = ratio[:1990], ratio[2010:]
    assert growing.max() == pytest.approx(1.1 * (1.0 + 0.2 * np.sqrt(2.0)), rel=1e-3)
    assert shrinking.min() == pytest.approx(0.9 * (1.0 - 0.2 * np.sqrt(2.0)), rel=1e-3)


def test_several_bodies_warm_as_a_sum_of_exponentials() -> None:
    motion = MOTION_IN_TIME
    since_s = motion.session_s
    warming = SeveralBodies(3.0, 900.0, bodies=((0.8, 1.0), (0.2, 5.0)))
    expected = 3.0 * (0.8 * -np.expm1(-since_s / 900.0) + 0.2 * -np.expm1(-since_s / 4500.0))
    np.testing.assert_allclose(warming.excess_k(motion), expected, atol=3e-3)
    cooling = SeveralBodies(0.0, 900.0, start_k=4.0, bodies=((0.7, 1.0), (0.3, 0.2)))
    expected = 4.0 * (0.7 * np.exp(-since_s / 900.0) + 0.3 * np.exp(-since_s / 180.0))
    np.testing.assert_allclose(cooling.excess_k(motion), expected, atol=3e-3)


@pytest.mark.parametrize("spread", [0.3, 0.7])
def test_a_stretched_warm_up_is_the_mean_over_a_log_normal_distribution(spread: float) -> None:
    warming = SeveralBodies(1.0, 900.0, bodies=stretched(spread))
    got = warming.excess_k(MOTION_IN_TIME)

    def rise(since_s: float) -> float:
        def weighed(z: float) -> float:
            return -np.expm1(-since_s / (900.0 * np.exp(spread * z))) * np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi)

        return float(quad(weighed, -8.0, 8.0, limit=200)[0])

    np.testing.assert_allclose(got, [rise(since_s) for since_s in MOTION_IN_TIME.session_s], atol=4e-3)


MOTION_IN_TIME = Motion(
    Scene(reference_machine(), table_ii_plan(1), ()),
    np.arange(0.0, 7200.0, 400.0),
    np.tile([[0.0, 0.0, -1008.0, 0.0, 0.0, 0.0]], (18, 1)),
)


def test_what_is_random_is_drawn_before_it_is_perturbed() -> None:
    with pytest.raises(ValueError, match="mounting is random still"):
        Perturbed(MountingScatter()).drawn(np.random.default_rng(1), MOTION.scene)


@pytest.fixture(scope="module")
def session() -> LinearSession:
    return LinearSession(scene_of(subset(table_ii_plan(3), ["a", "h", "l"])), 90)


PLACES_AND_NUMBERS = {
    "tool-ball-offset",
    "platform-joints",
    "bar-offset",
    "time-skew",
    "ball-coordinate",
    "mounting",
    "cog-shift",
    "strut-weight",
    "ujoint-screw",
}


def test_every_law_with_a_form_is_perturbed() -> None:
    assert set(LISTED) == set(DEVIATIONS) | PLACES_AND_NUMBERS
    assert set(DEVIATIONS) <= set(SINGLE)
    assert drawn_perturbation(np.random.default_rng(1), "bar-offset") is None


@pytest.mark.parametrize("name", DEVIATIONS)
def test_a_perturbed_effect_is_still_that_effect(name: str, session: LinearSession) -> None:
    shares = []
    for seed in range(6):
        effect = LISTED[name](np.random.default_rng(seed), session.scene)
        perturbation = drawn_perturbation(np.random.default_rng([seed, 3]), name)
        low, high = DEVIATIONS[name][0]
        assert low <= perturbation.size <= high
        law = effect.at(0.1 * effect.most)
        mechanism = perturbation.apply(law)
        assert (mechanism.name, mechanism.listed) == (law.name, True)
        exact = session.signature([law])
        if not np.any(exact):  # nothing changes along the circles of a perfect machine
            assert name == "bar-cyclic"
            continue
        off = session.signature([mechanism]) - exact
        shares.append(np.sqrt(np.mean(off**2) / np.mean(exact**2)) / perturbation.size)
    # As large as was asked for, within the chance of the draws.
    if shares:
        assert 0.2 < np.median(shares) < 2.5


def test_a_perturbed_session_can_be_recorded_and_its_truth_told(tmp_path) -> None:
    rng = np.random.default_rng(5)
    laws = [ScrewLead(), ScrewCyclic(), Backlash(), Gravity(), BarCyclic()]
    mechanisms = [drawn_perturbation(rng, law.name).apply(law) for law in laws]
    plan = subset(table_ii_plan(3), ["a"])
    truth = record(tmp_path / "s", seed=5, plan=plan, mechanisms=mechanisms, rate_hz=5.0)
    truth.write(tmp_path / "truth.json")
    told = {one["name"]: one["parameters"] for one in truth.as_dict()["mechanisms"]}
    assert [form["form"] for form in told["gravity"]["perturbed"]] == ["FromStrutToStrut", "ByLoad"]
    assert told["gravity"]["compliance_mm_n"] == Gravity().compliance_mm_n
    assert {key.name for key in fields(BowedScrewLead)} <= set(told["screw-lead"])
