"""Times and angles of imported runs against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.files.formats.mapping import AngleSchema
from dbbstation.plan.plan import Circle, Direction
from dbbstation.tasks.importing.travel import UnusableTravelError, machine_angles, travel


def circle(direction=Direction.CCW, start_deg=30.0):
    """150 mm at 6000 mm/min: 100 mm/s, 2/3 rad/s."""
    return Circle(
        ball_mm=(0.0, 0.0, 0.0),
        centre_mm=(0.0, 0.0, 0.0),
        bar_mm=150.0,
        tilt_deg=(0.0, 0.0, 0.0),
        feed_mm_min=6000.0,
        start_deg=start_deg,
        overshoot_deg=0.0,
        feed_in_mm=0.0,
        elevation_deg=0.0,
        direction=direction,
    )


SPEED_DEG_S = np.degrees(100.0 / 150.0)


def test_angles_from_plus_y_clockwise_lie_in_the_machine():
    """A file that counts from +Y clockwise: its 0 is +Y (90), its 90 is +X (0)."""
    said = AngleSchema(zero_deg=90.0, grows="cw")
    theta = machine_angles(np.array([0.0, 90.0, 180.0]), said, circle(Direction.CW))
    np.testing.assert_allclose(theta, [90.0, 0.0, -90.0])


@pytest.mark.parametrize(("direction", "sign"), [(Direction.CCW, 1.0), (Direction.CW, -1.0)])
def test_angles_along_the_travel_begin_where_the_plan_starts(direction, sign):
    theta = machine_angles(np.array([0.0, 10.0, 20.0]), AngleSchema(grows="travel"), circle(direction))
    np.testing.assert_allclose(theta, 30.0 + sign * np.array([0.0, 10.0, 20.0]))


def test_angles_against_the_direction_are_refused():
    with pytest.raises(UnusableTravelError, match="turn against cw"):
        machine_angles(np.array([0.0, 10.0]), AngleSchema(zero_deg=0.0, grows="ccw"), circle(Direction.CW))


def test_times_follow_from_angles_at_the_feed_over_a_step_of_a_turn():
    theta = np.array([340.0, 350.0, 0.0, 10.0])
    found = travel(None, theta, circle(), None)
    np.testing.assert_allclose(found.t_s, np.array([0.0, 10.0, 20.0, 30.0]) / SPEED_DEG_S)
    assert found.computed == ("times: computed from the angles at the plan's feed of 6000 mm/min",)


def test_angles_that_stand_still_give_no_times():
    with pytest.raises(UnusableTravelError, match="row 3"):
        travel(None, np.array([0.0, 1.0, 1.0, 2.0]), circle(), None)


@pytest.mark.parametrize(("direction", "sign"), [(Direction.CCW, 1.0), (Direction.CW, -1.0)])
def test_angles_of_a_turn_follow_from_times_at_the_feed(direction, sign):
    t_s = 5.0 + np.arange(0.0, 10.0, 0.1)
    found = travel(t_s, None, circle(direction), "turn")
    inside = SPEED_DEG_S * (t_s - 5.0) < 360.0
    assert 0 < inside.sum() < len(t_s)
    np.testing.assert_array_equal(found.rows, np.flatnonzero(inside))
    np.testing.assert_allclose(found.theta_deg, 30.0 + sign * SPEED_DEG_S * (t_s[inside] - 5.0))
    assert f"{(~inside).sum()} samples beyond the full turn are left out" in found.computed


def test_times_that_are_no_turn_at_the_feed_are_refused():
    with pytest.raises(UnusableTravelError, match=r"times span 5\.00 s, a turn takes 9\.42 s"):
        travel(np.linspace(0.0, 5.0, 100), None, circle(), "turn")


def test_times_of_a_clock_are_counted_from_the_first_sample():
    found = travel(np.array([1.7e9, 1.7e9 + 0.5]), None, circle(), "whole")
    np.testing.assert_array_equal(found.t_s, [0.0, 0.5])
    assert travel(np.array([2.0, 2.5]), None, circle(), "whole").t_s[0] == 2.0


def test_another_feed_than_the_plans_is_told():
    t_s = np.arange(0.0, 20.0, 0.1)
    found = travel(t_s, 0.5 * SPEED_DEG_S * t_s, circle(), None)
    assert found.computed == ("note: times and angles make a feed of 3000 mm/min, but the plan states 6000",)


@pytest.mark.parametrize(
    ("t_s", "trace", "what"),
    [
        (None, None, "neither"),
        ([0.0, 1.0], None, "no angles"),
        ([0.0, 1.0, 0.5], "whole", "row 3"),
        ([0.0, 0.0], "turn", "row 2"),
    ],
)
def test_what_no_run_can_have_is_refused(t_s, trace, what):
    with pytest.raises(UnusableTravelError, match=what):
        travel(None if t_s is None else np.array(t_s), None, circle(), trace)
