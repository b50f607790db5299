"""The plant in time: the path, the play operator, warm-up, drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.plant.drive_path import RunPath, Timing
from tests.plant.hexapod import strut_lengths
from tests.plant.machine import reference_machine
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.bar import BarDrift
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.play import Play
from tests.plant.mechanisms.play_operator import follower
from tests.plant.mechanisms.servo import ReversalSpike, ServoLag, TimeSkew
from tests.plant.mechanisms.thermal import SpindleGrowth, ThermalFrame, ThermalStruts
from tests.plant.mechanisms.warming import Warming
from tests.plant.noise import Noise
from tests.plant.plan import Path, Plan, elevated, subset, table_ii_plan
from tests.plant.run import Motion, Scene, Slot
from tests.plant.session import true_runs
from tests.plant.simulate import true_platform
from tests.plant.test_plant_machine import EMPTY

ONE_CIRCLE = subset(table_ii_plan(scatter_mm=0.0), ["a"])
FEED_MM_S = 1000.0 / 60.0


def one_path(direction: str = "ccw", plan: Plan = ONE_CIRCLE) -> RunPath:
    return RunPath(plan, plan.tests[0], "ccw" if direction == "ccw" else "cw", Timing())


def one_motion(times_s: np.ndarray, direction: str = "ccw", plan: Plan = ONE_CIRCLE) -> Motion:
    path = one_path(direction, plan)
    slot = Slot(plan.tests[0], path.direction, 1, 1, 0.0, path)
    return Motion(Scene(reference_machine(), plan, (slot,)), times_s, path.poses(times_s), slot)


def test_speed_is_the_feed_and_ramps_at_corners() -> None:
    path = one_path()
    times_s = np.arange(0.0, path.duration_s, 0.001)
    speed_mm_s = np.linalg.norm(np.diff(path.poses(times_s)[:, :3], axis=0), axis=1) / 0.001
    assert speed_mm_s.max() == pytest.approx(FEED_MM_S, rel=1e-6)
    acceleration_mm_s2 = np.abs(np.diff(speed_mm_s)) / 0.001
    assert acceleration_mm_s2.max() == pytest.approx(FEED_MM_S / 0.03, rel=0.05)
    # Two outer dwells of 1 s and two corner dwells of 0.3 s; the moves with one ramp time each.
    moves_s = (2 * 1.5 + np.radians(450) * 150) / FEED_MM_S + 3 * 0.03
    assert path.duration_s == pytest.approx(2.6 + moves_s, rel=1e-12)
    assert (speed_mm_s < 1e-9).mean() * path.duration_s == pytest.approx(2.6, abs=0.02)


@pytest.mark.parametrize("direction", ["ccw", "cw"])
def test_angles_follow_from_the_feed_anchored_between_the_edges(direction: str) -> None:
    path = one_path(direction)
    times_s = np.arange(0.0, path.duration_s, 0.001)
    reach_mm = np.linalg.norm(path.poses(times_s)[:, :3] - path.centre_mm, axis=1)
    outside = np.flatnonzero(np.diff((reach_mm > 150.75).astype(int)))
    middle_s = (times_s[outside[0]] + times_s[outside[1]] + 0.001) / 2
    phi_deg = 180.0 + np.degrees((times_s - middle_s) * FEED_MM_S / 150.0)
    inside = path.in_circle(times_s)
    sign = 1.0 if direction == "ccw" else -1.0
    np.testing.assert_allclose(path.angle_deg(times_s)[inside], (sign * phi_deg)[inside], atol=0.01)
    assert phi_deg[inside].min() == pytest.approx(0.0, abs=0.02)
    assert phi_deg[inside].max() == pytest.approx(360.0, abs=0.02)
    pose = path.poses(times_s[inside][:1])[0]
    np.testing.assert_allclose(pose[:3], path.centre_mm + np.array([150.0, 0.0, 0.0]), atol=0.02)


def test_a_raised_bar_describes_a_smaller_circle_higher_up() -> None:
    path = one_path(plan=elevated(ONE_CIRCLE, 30.0, ["a"]))
    times_s = np.linspace(*path.arc_s, 50)
    off_mm = path.poses(times_s)[:, :3] - path.centre_mm
    np.testing.assert_allclose(np.hypot(off_mm[:, 0], off_mm[:, 1]), 150.0 * np.cos(np.radians(30)), rtol=1e-12)
    np.testing.assert_allclose(off_mm[:, 2], 75.0, rtol=1e-12)
    # The feed-in runs along the bar.
    start_mm = path.poses(np.zeros(1))[0, :3] - path.centre_mm
    np.testing.assert_allclose(start_mm / np.linalg.norm(start_mm), off_mm[0] / 150.0, atol=1e-12)
    assert np.linalg.norm(start_mm) == pytest.approx(151.5)


def test_the_follower_of_a_play_runs_round_the_known_loop() -> None:
    driver = np.concatenate([np.linspace(0, 2, 41), np.linspace(2, -2, 81)[1:], np.linspace(-2, 2, 81)[1:]])
    out = follower(driver, 0.5)
    up, down, again = out[:41], out[40:121], out[120:]
    np.testing.assert_allclose(up, np.maximum(driver[:41] - 0.5, 0.0))
    np.testing.assert_allclose(down, np.minimum(1.5, driver[40:121] + 0.5))
    np.testing.assert_allclose(again, np.maximum(-1.5, driver[120:] - 0.5))
    # Work lost in a closed loop: gap times twice the travel less the gap.
    loop_area = np.trapezoid(down, driver[40:121]) + np.trapezoid(again, driver[120:])
    assert abs(loop_area) == pytest.approx(1.0 * (4.0 - 1.0), rel=1e-3)


def test_the_follower_walks_as_sample_by_sample() -> None:
    rng = np.random.default_rng(8)
    driver = np.concatenate([np.zeros(3), np.cumsum(rng.standard_normal(300)), np.full(4, 2.0)])
    last, expected = 0.2, []
    for value in driver:
        last = max(value - 0.8, min(value + 0.8, last))
        expected.append(last)
    np.testing.assert_allclose(follower(driver, 0.8, start_offset=0.2), expected, atol=1e-14)


@pytest.mark.parametrize("driver", [[1.0], [1.0, 1.0, 1.0], [1.0, 3.0]])
def test_the_follower_of_short_histories(driver: list[float]) -> None:
    out = follower(np.array(driver), 0.5)
    assert out[0] == pytest.approx(1.0)
    assert out[-1] == pytest.approx(driver[-1] if driver[-1] == 1.0 else 2.5)


def test_backlash_is_half_a_gap_against_the_strut_and_changes_sign_with_direction() -> None:
    gap_um = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    off = {}
    for direction in ("ccw", "cw"):
        times_s = np.arange(0.0, one_path().duration_s, 0.02)
        motion = one_motion(times_s, direction)
        change_um = 1000.0 * Backlash(gap_um).driven_mm(motion, motion.commanded_mm)
        # Late in the circle every strut has turned round at least once.
        late = motion.in_circle & (times_s > 40.0) & (np.abs(motion.strut_speed_mm_s).min(axis=1) > 1.0)
        expected_um = -np.sign(motion.strut_speed_mm_s[late]) * np.array(gap_um) / 2
        np.testing.assert_allclose(change_um[late], expected_um, atol=1e-9)
        off[direction] = change_um[late].std()
    assert off["ccw"] == pytest.approx(off["cw"], rel=0.05)


def test_play_hangs_on_the_side_of_the_load() -> None:
    plan = table_ii_plan(scatter_mm=0.0)
    run = next(run for run in true_runs(plan, []) if run.slot.test.name == "h")
    motion = Motion(Scene(reference_machine(), plan, ()), run.time_s, run.slot.path.poses(run.time_s), run.slot)
    platform = true_platform(motion, [Gravity()])
    place_um = 1000.0 * Play((5.0,) * 6, friction_n=50.0).lengthening_mm(motion, platform)
    loaded = np.abs(platform.tension_n) > 51.0
    np.testing.assert_allclose(place_um[loaded], 2.5 * np.sign(platform.tension_n[loaded]))
    assert (np.sign(platform.tension_n) < 0).any()
    assert np.abs(place_um).max() <= 2.5 + 1e-9


def test_warming_is_the_step_response_of_one_body() -> None:
    times_s = np.linspace(0.0, 5000.0, 40)
    motion = Motion(Scene(reference_machine(), EMPTY, ()), times_s, np.zeros((40, 6)))
    excess_k = Warming(rise_k=3.0, time_constant_s=900.0).excess_k(motion)
    np.testing.assert_allclose(excess_k, 3.0 * (1.0 - np.exp(-times_s / 900.0)), atol=2e-6)


def test_warming_through_a_second_body() -> None:
    times_s = np.linspace(0.0, 5000.0, 40)
    motion = Motion(Scene(reference_machine(), EMPTY, ()), times_s, np.zeros((40, 6)))
    excess_k = Warming(3.0, 900.0, second_time_constant_s=300.0, head_start_s=200.0).excess_k(motion)
    since_s = times_s + 200.0
    expected_k = 3.0 * (1.0 - (900.0 * np.exp(-since_s / 900.0) - 300.0 * np.exp(-since_s / 300.0)) / 600.0)
    np.testing.assert_allclose(excess_k, expected_k, atol=1e-5)


def test_warming_by_runs_alone_follows_the_differential_equation() -> None:
    runs = true_runs(subset(table_ii_plan(scatter_mm=0.0), "ab"), [], rate_hz=0.5)
    scene = Scene(reference_machine(), table_ii_plan(), tuple(run.slot for run in runs))
    warming = Warming(rise_k=2.0, time_constant_s=300.0, idle_share=0.2)
    times_s = np.linspace(1.0, scene.end_s, 50)

    def rate(time_s: float, now_k: np.ndarray) -> np.ndarray:
        heated = any(slot.start_s <= time_s < slot.end_s for slot in scene.slots)
        return (2.0 * (1.0 if heated else 0.2) - now_k) / 300.0

    solution = solve_ivp(rate, (0.0, scene.end_s), [0.0], t_eval=times_s, max_step=0.5)
    excess_k = warming.excess_k(Motion(scene, times_s, np.zeros((50, 6))))
    # Heat is counted by whole seconds.
    np.testing.assert_allclose(excess_k, solution.y[0], atol=0.01)


def test_a_machine_left_off_cools_as_newton_says() -> None:
    times_s = np.array([0.0, 600.0, 1200.0])  # heat is counted by whole seconds
    motion = Motion(Scene(reference_machine(), EMPTY, ()), times_s, np.zeros((3, 6)))
    cooling = Warming(rise_k=0.0, time_constant_s=600.0, start_k=4.0)
    np.testing.assert_allclose(cooling.excess_k(motion), 4.0 * np.exp([0.0, -1.0, -2.0]), rtol=2e-3)
    paused = Warming(rise_k=3.0, time_constant_s=600.0, off_s=((600.0, 1200.0),))
    warm_k = 3.0 * (1.0 - np.exp(-1.0))
    np.testing.assert_allclose(paused.excess_k(motion), [0.0, warm_k, warm_k * np.exp(-1.0)], rtol=2e-3)


def test_grown_parts_keep_to_their_expansion() -> None:
    slow = Warming(rise_k=2.0, time_constant_s=1.0, head_start_s=60.0)
    times_s = np.array([30.0, 35.0])
    motion = one_motion(times_s)
    machine = reference_machine()
    struts = true_platform(motion, [ThermalStruts(slow, 11.5)])
    np.testing.assert_allclose(struts.length_mm / strut_lengths(machine, motion.commanded) - 1, 23e-6, rtol=1e-4)
    frame = true_platform(motion, [ThermalFrame(slow, 11.5)])
    np.testing.assert_allclose(frame.base_mm - machine.base_joints_mm, [23e-6 * machine.base_joints_mm] * 2, atol=1e-8)
    ball_mm = SpindleGrowth(slow, 3.0).tool_ball_mm(motion, frame)
    np.testing.assert_allclose(ball_mm, [[0.0, 0.0, -0.006]] * 2, rtol=1e-6)
    bar_mm = BarDrift(slow, 10.6).reading_mm(motion, frame, np.full(2, 150.0))
    np.testing.assert_allclose(bar_mm, -150.0 * 10.6e-6 * 2.0, rtol=1e-6)


def test_a_common_lag_shrinks_the_circle_by_the_textbook_amount() -> None:
    plan = replace(ONE_CIRCLE, path=Path(feed_mm_min=6000.0))
    lag_s = 0.02
    lagged = true_runs(plan, [ServoLag((1000.0 * lag_s,) * 6)], rate_hz=50.0)[0]
    shrunk_mm = 150.0 - lagged.length_mm[lagged.in_circle].mean()
    # (v τ)²/2R for a delay and for a first-order filter alike, here 13 µm. Struts are not the tool: their own speeds
    # differ along the circle, which leaves a smaller part that is no shrinkage.
    assert shrunk_mm == pytest.approx((100.0 * lag_s) ** 2 / 300.0, rel=0.05)


def test_a_late_sample_reads_what_came_later() -> None:
    times_s = np.arange(0.0, 20.0, 0.02)
    motion = one_motion(times_s)
    assert float(TimeSkew(5.0).sampled_s(motion)) == pytest.approx(0.005)
    on_time, late = (true_runs(ONE_CIRCLE, mechanisms, rate_hz=50.0)[0] for mechanisms in ([], [TimeSkew(20.0)]))
    # One sample of 20 ms: the feed-in edge comes one row earlier, angles are written as before.
    np.testing.assert_allclose(late.length_mm[:-1], on_time.length_mm[1:], atol=1e-9)
    np.testing.assert_array_equal(late.theta_deg, on_time.theta_deg)


def test_a_spike_stands_at_every_reversal_and_decays() -> None:
    times_s = np.arange(0.0, one_path().duration_s, 0.01)
    motion = one_motion(times_s)
    spike_um = 1000.0 * ReversalSpike((4.0,) * 6, decay_s=0.2).driven_mm(motion, motion.commanded_mm)
    for strut in range(6):
        speed = motion.strut_speed_mm_s[:, strut]
        turns = np.flatnonzero((speed[:-1] * speed[1:] < 0) & motion.in_circle[:-1])
        assert len(turns) in {1, 2, 3}
        for turn in turns:
            after = slice(turn + 1, turn + 60)
            since_s = times_s[after] - times_s[turn] - 0.005
            expected_um = 4.0 * np.sign(speed[turn]) * np.exp(-since_s / 0.2)
            np.testing.assert_allclose(spike_um[after, strut], expected_um, atol=0.2)


def test_noise_has_the_sizes_asked_for() -> None:
    noise_um = 1000.0 * Noise(0.3, 0.4, correlation=0.6).drawn_mm(np.random.default_rng(1), 200_000)
    assert noise_um.std() == pytest.approx(0.5, rel=0.01)
    assert np.mean(noise_um[1:] * noise_um[:-1]) == pytest.approx(0.6 * 0.16, rel=0.05)


def test_coloured_noise_is_as_loud_to_a_mean_as_white_noise_of_its_slow_size() -> None:
    noise = Noise(0.3, 0.4, correlation=0.6, second_um=0.2, second_correlation=0.95)
    noise_um = 1000.0 * noise.drawn_mm(np.random.default_rng(2), 2_000_000)
    means_um = noise_um.reshape(-1, 2000).mean(axis=1)
    assert means_um.std() * np.sqrt(2000) == pytest.approx(noise.slow_um, rel=0.1)
