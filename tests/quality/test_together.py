"""Where a circle should lie by what circles of other tests show: by draws of normal variables, and on machines of the plant."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from dbbstation.plan.plan import Circle, Direction
from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.forms import Forms, form_of
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import seen
from dbbstation.quality.together import Together, expected_beside, together
from dbbstation.trace.expected import COEFFICIENTS, Expected, along_travel
from tests.quality.sessions import finding_of
from tests.quality.spoilers import elsewhere, larger, mirrored

N = COEFFICIENTS
TESTS = 6


def run(test: str, circle: Circle, off_um: np.ndarray, effects_um: np.ndarray) -> SimpleNamespace:
    """A run with a noise of one micrometre, whose form is off by so much along its travel."""
    signs = along_travel(circle)
    effects = {("machine", ""): signs[:, None] * effects_um}
    expected = Expected(np.array([0.01, -0.02]), 0.005, np.eye(3), effects_um=effects)
    of_it = SimpleNamespace(test=test, circle=circle, expected=expected, started_s=None)
    return SimpleNamespace(run=of_it, coefficients_um=signs * off_um, u_um=1.0, drift_um_s=0.0)


def beside(circle: Circle, off: np.ndarray, effects: np.ndarray) -> Together:
    runs = [run(str(k), circle, off[N * k : N * (k + 1)], effects[N * k : N * (k + 1)]) for k in range(TESTS)]
    forms = Forms(lambda held: form_of(held[0], held[0].coefficients_um[:, None] * along_travel(circle)[:, None]))
    return together(runs[0], runs, forms)  # type: ignore[arg-type, return-value]  # what is asked of runs is there


@pytest.mark.parametrize("direction", list(Direction))
def test_a_circle_lies_where_draws_of_the_same_causes_put_it(direction: Direction) -> None:
    """A machine of six causes, 0.3 times their usual size: 95 % of the centres are inside, and the mean is known to a tenth."""
    rng = np.random.default_rng(4)
    start, elevation = np.radians(30.0), 60.0
    circle = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 30.0, 45, 1.5, elevation, direction)
    effects = rng.normal(0.0, 100.0, (N * TESTS, 6))
    inside, draws, shifts = 0, 300, []
    for _ in range(draws):
        off = effects @ rng.normal(0.0, 0.3, 6) + rng.normal(0.0, 1.0, N * TESTS)
        found = expected_beside(beside(circle, off, effects))
        # A shift d along the start of the turn, and one e across it along the travel, move readings by cos 60° (d cos phi + e sin phi).
        along, across = np.sqrt(2.0) * off[1] / 0.5, np.sqrt(2.0) * off[N // 2 + 1] / 0.5 * direction.sign
        turn = np.array([[np.cos(start), -np.sin(start)], [np.sin(start), np.cos(start)]])
        true = np.array([10.0, -20.0, 5.0]) + np.append(turn @ [along, across], off[0])
        apart = true - 1e3 * np.append(found.centre_mm, found.radial_mm)
        inside += apart @ np.linalg.solve(1e6 * found.covariance_mm2, apart) <= chi2.ppf(0.95, 3)
        shifts.append((np.linalg.norm(true), np.linalg.norm(apart)))
    assert binom.ppf(0.001, draws, 0.95) <= inside <= binom.ppf(0.999, draws, 0.95) + 1
    usual, left = np.mean(shifts, axis=0)
    assert left < 0.1 * usual


def test_tests_that_stray_widen_what_is_expected() -> None:
    rng = np.random.default_rng(5)
    circle = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0.0, 45, 1.5, 0, Direction.CCW)
    effects = rng.normal(0.0, 100.0, (N * TESTS, 6))
    of_machine = effects @ rng.normal(0.0, 1.0, 6)
    sizes = []
    for size_um in (1.0, 10.0):
        off = of_machine + rng.normal(0.0, size_um, N * TESTS)
        found = expected_beside(beside(circle, off, effects))
        sizes.append(float(np.sqrt(np.trace(found.covariance_mm2))))
    assert 5.0 < sizes[1] / sizes[0] < 20.0


def test_nothing_is_expected_beside_no_others() -> None:
    assert expected_beside(None) is None


@pytest.fixture
def whole(six_tests):
    return six_tests


def both_spoilt(whole, test, spoiler, *sizes):
    return [
        seen(replace(one.run, recording=spoiler(one.run.recording, one.run.circle, *sizes)))
        if one.run.test == test
        else one
        for one in whole.runs
    ]


def test_sound_circles_lie_where_the_others_put_them(whole):
    """Nothing is wrong, and places are known to a tenth of a millimetre: without other tests to 1.8 mm."""
    session = SessionRuns(whole.runs)
    for one in whole.runs:
        judged = session.judge(one)
        assert judged.wrong == (), one.run.label
        assert finding_of(judged, Name.BORE).limit < 150.0
        assert finding_of(judged, Name.RADIUS).limit < 30.0
    alone = SessionRuns([]).judge(whole.runs[0])
    assert finding_of(alone, Name.BORE).limit > 1000.0


def test_a_ball_that_stands_elsewhere_in_both_directions_is_found(whole):
    runs = both_spoilt(whole, "h", elsewhere, 300.0)
    judged = SessionRuns(runs).judge(next(one for one in runs if one.run.label == "h cw 1"))
    found = finding_of(judged, Name.BORE)
    assert found.verdict is FindingVerdict.WRONG
    assert "expected by the other tests" in found.text
    assert finding_of(judged, Name.OTHER_DIRECTION).verdict is FindingVerdict.GOOD


def test_a_bar_of_another_length_in_one_test_is_found(whole):
    runs = both_spoilt(whole, "d", larger, 100.0)
    judged = SessionRuns(runs).judge(next(one for one in runs if one.run.label == "d cw 1"))
    assert finding_of(judged, Name.RADIUS).verdict is FindingVerdict.WRONG


def test_both_directions_the_wrong_way_round_are_found(whole):
    across = {one.run.label: one.coefficients_um[4] for one in whole.runs}
    assert abs(across["h ccw 1"]) > 10.0, "this machine's circle lies on the axis through its start"
    runs = both_spoilt(whole, "h", mirrored, 1.0)
    judged = SessionRuns(runs).judge(next(one for one in runs if one.run.label == "h cw 1"))
    assert judged.wrong
