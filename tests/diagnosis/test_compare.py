"""Two sessions side by side: pairs, whether they differ, and by which cause. Readings are made here, without the model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from dbbstation.diagnosis.compare.comparison import compare
from dbbstation.diagnosis.compare.pairs import NotComparable, at_common_angles, match
from dbbstation.diagnosis.compare.set_up import ALIKE, JIG
from dbbstation.errors import TraceError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.inference.levels import Verdict
from dbbstation.model.observation import Observation
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import Setup
from dbbstation.trace.recording import RawCircle
from tests.plant.plan import EIGHT

NOISE_MM, MOUNTING_MM, BALL_MM, BAR_MM = 0.0004, 0.001, 0.0005, 0.0005
PLAN = read_plan(shipped_folder("protocols") / "plans" / "table2.yaml")
ALL = "abcdefghijklmno"
BOTH = (Direction.CCW, Direction.CW)


def hexapod(reference):
    return reference.hexapod.base_joints_mm, reference.hexapod.platform_joints_mm


def tilt_matrix(a_deg, b_deg):
    a, b = np.radians([a_deg, b_deg])
    rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    return rx @ ry


def strut_gain(reference, circle, theta_deg):
    """Bar length per strut length, by solving J dpose = dL of the textbook Jacobian pose by pose, shape (n, 6)."""
    base, platform = hexapod(reference)
    turn = tilt_matrix(*circle.tilt_deg[:2])
    gains = []
    for theta in np.radians(theta_deg):
        out = np.array([np.cos(theta), np.sin(theta), 0.0])
        arm = platform @ turn.T
        leg = np.array(circle.centre_mm) + circle.bar_mm * out + arm - base
        unit = leg / np.linalg.norm(leg, axis=1)[:, None]
        jacobian = np.hstack([unit, np.cross(arm, unit)])
        gains.append(out @ np.linalg.inv(jacobian)[:3])
    return np.array(gains)


def unchanged(*_):
    return 0.0


class Workshop:
    """Makes sessions of readings: a machine's shape, balls that sit anew, noise."""

    def __init__(self, seed, tests=EIGHT, samples=180):
        self.rng = np.random.default_rng(seed)
        self.tests, self.samples, self.start_deg = tests, samples, 0.0
        self.shape = {test: self.rng.normal(0, 0.02, 12) for test in tests}

    def session(self, name, change=unchanged):
        runs = []
        for test in self.tests:
            planned = PLAN.tests[test]
            ball = self.rng.normal(0, MOUNTING_MM, 2)
            for direction in BOTH:
                circle = replace(planned.run(direction), start_deg=self.start_deg)
                phi = (np.arange(self.samples) + self.rng.uniform(0, 1)) * (360.0 / self.samples)
                theta_deg = circle.theta_deg(phi) % 360.0
                theta, started_s = np.radians(theta_deg), 200.0 * len(runs)
                waves = [f(k * theta) for k in range(1, 7) for f in (np.cos, np.sin)]
                length = circle.bar_mm + self.shape[test] @ np.array(waves)
                length -= ball @ np.array([np.cos(theta), np.sin(theta)])
                length = length + change(circle, theta_deg, started_s) + self.rng.normal(0, NOISE_MM, self.samples)
                raw = RawCircle(name, circle, phi / circle.turning_deg_s, phi, length)
                at = np.array(planned.ball.centre_mm)
                setup = Setup(name, f"{name} {test}", f"{name} {test}", name, at, MOUNTING_MM, BALL_MM, BAR_MM)
                runs.append(Observation(test, 1, raw, setup, started_s))
        return runs


def the_cause(found, verdict=Verdict.IDENTIFIED):
    assert [finding.verdict for finding in found.there] == [verdict]
    return found.there[0]


@pytest.mark.slow
@pytest.mark.parametrize(("draws", "samples"), [(4, 180), pytest.param(100, 360, marks=pytest.mark.nightly)])
def test_noise_and_mountings_alone_are_no_difference(reference, draws, samples):
    """One truth, new noise and balls put up anew: of what is said with 0.95, one in twenty may be wrong."""
    found = []
    for seed in range(draws):
        shop = Workshop(seed, tests="abgl", samples=samples)
        found.append(compare(reference, shop.session("A"), shop.session("B")))
    assert np.count_nonzero([one.differ for one in found]) <= binom.isf(1e-3, draws, 0.05)
    assert np.count_nonzero([any(run.differs for run in one.runs) for one in found]) <= binom.isf(1e-3, draws, 0.05)


def test_a_strut_that_became_longer_is_told(reference):
    shop = Workshop(1, tests=ALL, samples=540)
    a = shop.session("A")
    b = shop.session("B", lambda circle, theta, _: strut_gain(reference, circle, theta)[:, 2] * 0.0015)
    found = compare(reference, a, b)
    assert found.differ
    assert found.probability > 0.999
    best = the_cause(found)
    assert (best.name, best.label) == ("strut-reference-length", "strut 3")
    length = best.values["strut_3_mm"]
    assert length.value == pytest.approx(0.0015, abs=4 * length.uncertainty)
    assert length.uncertainty < 0.0001
    effect = found.effects[best.name]
    assert effect.share > 0.9
    assert effect.taken_up > 0.999
    assert effect.opposite < 1e-3
    assert found.held_out[1].rms < found.held_out[0].rms
    assert found.left.is_noise


def test_the_bar_is_told(reference):
    shop = Workshop(2, tests="abgl")
    found = compare(reference, shop.session("A"), shop.session("B", lambda *_: 0.005))
    assert found.differ
    best = the_cause(found, Verdict.HAPPENED)
    assert best.name == "bar-offset"
    assert [one.where for one in found.levels.follows] == [ALIKE]
    (offset,) = best.values.values()
    assert offset.value == pytest.approx(0.005, abs=2 * np.hypot(BAR_MM, BAR_MM))
    assert all(run.mean_radial_change_um == pytest.approx(5.0, abs=0.2) for run in found.runs)
    # 5 µm where both bars together are known to 0.7 µm: seven sigma in every run.
    assert all(
        run.mean_radial_change_uncertainty_um == pytest.approx(1e3 * np.hypot(BAR_MM, BAR_MM), rel=0.05)
        for run in found.runs
    )


def test_one_curve_in_all_tests_is_the_set_ups_and_one_of_a_strut_is_not(reference):
    """A ball that is out of round by 2 µm: cos 3 theta in every run, whatever the pose; and a strut's length."""

    def out_of_round(_, theta_deg, __):
        return 0.002 * np.cos(np.radians(3.0 * theta_deg))

    def longer(circle, theta_deg, _):
        return 0.002 * strut_gain(reference, circle, theta_deg)[:, 4]

    for change, alike in ((out_of_round, True), (longer, False)):
        shop = Workshop(12, tests="abgl")
        found = compare(reference, shop.session("A"), shop.session("B", change))
        assert found.levels.follows
        assert [one.where == ALIKE for one in found.levels.follows] == [alike] * len(found.levels.follows)


def test_a_constant_within_what_is_stated_of_the_bars_is_no_difference(reference):
    shop = Workshop(3, tests="abgl")
    assert not compare(reference, shop.session("A"), shop.session("B", lambda *_: 0.001)).differ


def test_one_ball_that_sits_badly_is_found_in_its_two_runs(reference):
    shop = Workshop(4, tests="abdgl")

    def shifted(circle, theta_deg, _):
        return -0.02 * np.cos(np.radians(theta_deg)) * (circle.ball_mm == PLAN.tests["d"].ball.centre_mm)

    found = compare(reference, shop.session("A"), shop.session("B", shifted))
    different = [run for run in found.runs if run.differs]
    assert [run.pair.label for run in different] == ["d ccw 1", "d cw 1"]
    worst = different[0]
    assert worst.centre_shift_um == pytest.approx((-20.0, 0.0), abs=5 * worst.centre_shift_uncertainty_um)
    assert worst.centre_shift_uncertainty_um == pytest.approx(
        1e3 * np.sqrt(2) * np.hypot(MOUNTING_MM, BALL_MM), rel=0.02
    )
    assert worst.circularity_um < 1.0
    best = the_cause(found, Verdict.HAPPENED)
    assert (best.name, best.label, found.effects[best.name].where.test) == ("mounting", "test d", "d")


def test_a_jig_that_was_put_down_elsewhere_is_one_body(reference):
    shop = Workshop(5, tests=ALL)

    def moved(circle, theta_deg, _):
        x, y, _z = circle.ball_mm
        shift = np.array([0.01 - 50e-6 * y, -0.02 + 50e-6 * x])  # and turned by 50 µrad about Z
        theta = np.radians(theta_deg)
        return -(shift[0] * np.cos(theta) + shift[1] * np.sin(theta))

    best = the_cause(compare(reference, shop.session("A"), shop.session("B", moved)))
    assert best.name == JIG
    for name, true, known in (("x_mm", 0.01, 0.001), ("y_mm", -0.02, 0.001), ("turn_z_rad", 50e-6, 10e-6)):
        assert best.values[name].value == pytest.approx(true, abs=4 * best.values[name].uncertainty)
        assert best.values[name].uncertainty < known
    assert "z_mm" not in best.values  # circles with a level bar see nothing of it


def test_a_drift_is_told_from_a_constant(reference):
    shop = Workshop(6, tests="abgl")
    found = compare(reference, shop.session("A"), shop.session("B", lambda _c, _t, started: 1e-6 * started))
    assert found.there[0].name in {"bar-drift", "drift with time in B", "curve over time in B", "offset by block"}
    assert found.there[0].verdict is Verdict.HAPPENED
    assert found.effects[found.there[0].name].share > 0.9


@pytest.mark.slow
def test_what_changes_its_sign_with_the_direction(reference):
    shop = Workshop(8, tests="abgl")

    def reversal(circle, theta_deg, _):
        return circle.direction.sign * 0.001 * np.sign(np.sin(np.radians(theta_deg)))

    found = compare(reference, shop.session("A"), shop.session("B", reversal))
    assert found.differ
    assert found.effects[found.there[0].name].opposite > 0.99
    halves = found.directions
    # A square wave of 1 µm; a little of it could be angles that were cut wrongly.
    assert 0.85 < halves.opposite_um < 1.02
    assert halves.same_um < 0.2


def test_a_difference_without_order_is_called_that(reference):
    shop = Workshop(9, tests="abgl")
    own = {test.ball.centre_mm: shop.rng.normal(0, 0.002, 6) for test in PLAN.tests.values()}

    def change(circle, theta_deg, _):
        theta = np.radians(theta_deg)
        waves = np.array([f(k * theta) for k in (2, 3, 4) for f in (np.cos, np.sin)])
        return own[circle.ball_mm] @ waves

    found = compare(reference, shop.session("A"), shop.session("B", change))
    assert found.differ
    assert all(run.differs for run in found.runs)
    best = the_cause(found, Verdict.HAPPENED)
    assert (best.name, best.label) == ("curve over angle, test by test", "each test its own")
    # What every test has of its own foretells nothing of another one.
    assert found.held_out[1].rms == pytest.approx(found.held_out[0].rms, rel=0.02)


def test_other_samplings_and_starts_are_no_difference(reference):
    """Centres 20 µm off: a quarter of a degree is 0.1 µm, which would show."""
    shop = Workshop(10, tests="abgl")
    a = shop.session("A")
    shop.samples, shop.start_deg = 1300, 90.0
    assert not compare(reference, a, shop.session("B")).differ


def test_common_angles_lose_nothing_of_a_smooth_curve():
    circle = PLAN.tests["a"].run(Direction.CW)
    phi = np.sort(np.random.default_rng(1).uniform(0, 360, 900))

    def curve(theta_deg):
        theta = np.radians(theta_deg)
        return 0.1 * np.cos(theta) + 0.02 * np.sin(3 * theta)

    raw = RawCircle("r", circle, phi, phi, circle.bar_mm + curve(circle.theta_deg(phi)))
    found = at_common_angles(raw, 180)
    there = np.isfinite(found)
    middles = (np.arange(180) + 0.5) * 2.0
    assert np.count_nonzero(there) > 170
    assert found[there] == pytest.approx(curve(middles)[there], abs=1e-6)


def test_runs_are_matched_by_test_and_direction():
    shop = Workshop(11, tests="abc")
    a, b = shop.session("A"), shop.session("B")
    matching = match([run for run in a if run.test != "c"], [run for run in b if run.label != "a cw 1"])
    assert [pair.label for pair in matching.pairs] == ["a ccw 1", "b ccw 1", "b cw 1"]
    assert matching.only_a == ("a cw",)
    assert matching.only_b == ("c ccw", "c cw")
    assert (matching.not_comparable, matching.averaged) == ((), ())


def test_repeats_pair_in_order_or_are_averaged():
    shop = Workshop(12, tests="a", samples=360)
    a, b, again = shop.session("A"), shop.session("B"), shop.session("B")
    twice = [replace(run, repeat=3) for run in again]
    pairs = match([*a, *twice], [*b, *twice]).pairs
    assert [pair.label for pair in pairs] == ["a ccw 1", "a ccw 2", "a cw 1", "a cw 2"]
    matching = match(a, [*b, *twice])
    assert matching.averaged == ("a ccw: mean of 1 against mean of 2", "a cw: mean of 1 against mean of 2")
    one, other = (at_common_angles(run.raw, 180) for run in (b[0], again[0]))
    assert matching.pairs[0].b_mm == pytest.approx((one + other) / 2)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"bar_mm": 100.0}, "bar length 150 mm in A, 100 in B"),
        ({"tilt_deg": (1.0, 0.0, 0.0)}, "tilt 0 0 0 degrees in A, 1 0 0 in B"),
        ({"elevation_deg": 5.0}, "elevation 0 degrees in A, 5 in B"),
        ({"ball_mm": (100.0, 0.0, -1150.0)}, "ball 0 0 -1150 mm in A, 100 0 -1150 in B"),
    ],
)
def test_equal_names_of_different_circles_are_not_compared(change, what):
    shop = Workshop(13, tests="ab")
    a, b = shop.session("A"), shop.session("B")
    b = [
        replace(run, raw=replace(run.raw, circle=replace(run.raw.circle, **change))) if run.test == "a" else run
        for run in b
    ]
    matching = match(a, b)
    assert {pair.test for pair in matching.pairs} == {"b"}
    assert matching.not_comparable == (NotComparable("a", what),)


def test_cmm_differences_of_a_ball_are_one_circle():
    shop = Workshop(14, tests="a")
    a = shop.session("A")
    b = [replace(run, raw=replace(run.raw, circle=replace(run.raw.circle, ball_mm=(0.02, 0.0, -1150.03)))) for run in a]
    assert len(match(a, b).pairs) == 2


def test_nothing_in_common():
    with pytest.raises(TraceError, match="no run in common"):
        match(Workshop(1, tests="ab").session("A"), Workshop(1, tests="c").session("B"))


def test_removed_centres_are_refused(reference):
    shop = Workshop(15, tests="abc")
    a, b = shop.session("A"), shop.session("B")
    removed = []
    for run in b:
        theta = np.radians(run.raw.theta_deg)
        columns = np.column_stack([np.cos(theta), np.sin(theta)])
        centre, *_ = np.linalg.lstsq(columns, run.raw.length_mm - 150.0, rcond=None)
        removed.append(replace(run, raw=replace(run.raw, length_mm=run.raw.length_mm - columns @ centre)))
    with pytest.raises(TraceError, match="in session B all circles lie on their commanded centres"):
        compare(reference, a, removed)


def test_two_simulations_without_noise_are_the_same_to_what_a_bar_shows(reference):
    shop = Workshop(16, tests="abc", samples=360)
    a = shop.session("A")
    found = compare(reference, a, a)
    assert (found.rms_mm, found.there, found.differ) == (0.0, (), False)
