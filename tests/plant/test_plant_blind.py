"""Blind studies: sizes by another way of counting, kinds as asked for, the same bytes from the same seed."""

from __future__ import annotations

import json
from pathlib import Path as FilePath

import numpy as np
import pytest

from tests.plant.blind.circumstances import drawn
from tests.plant.blind.disturbances import DISTURBANCES, NAME_ON_THE_LIST
from tests.plant.blind.families import families
from tests.plant.blind.hide import Hidden, Hider
from tests.plant.blind.limits import BAR_UM, FREE_MM, Limits
from tests.plant.blind.listed import CONCEALED, LISTED, SINGLE
from tests.plant.blind.sessions import KINDS, Task, make_session, make_study, tasks
from tests.plant.blind.unlisted import UNLISTED
from tests.plant.linear import LinearSession
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.servo import TimeSkew
from tests.plant.noise import Noise
from tests.plant.plan import HOLDER_REPEATABILITY_UM, subset, table_ii_plan
from tests.plant.session import scene_of


@pytest.fixture(scope="module")
def session() -> LinearSession:
    return LinearSession(scene_of(subset(table_ii_plan(3), ["a", "h", "l"])), 40)


def test_standard_deviations_are_those_of_generalised_least_squares(session: LinearSession) -> None:
    noise, rate_hz = Noise(0.4), 20.0
    signature = session.signature([Backlash((2.0, 0.0, 0.0, 0.0, 0.0, 0.0))])
    # The whole covariance of the readings [mm²], with everything random in it but the kinematic parameters.
    covariance = np.diag((noise.white_um / 1000.0) ** 2 * session.samples_per_s / rate_hz)
    covariance += (BAR_UM / 1000.0) ** 2 * np.ones_like(covariance)
    for k, test in enumerate(session.scene.plan.tests):
        ball = session.scene.plan.ball(test.ball)
        both_um2 = HOLDER_REPEATABILITY_UM[ball.holder] ** 2 + ball.uncertainty_um**2
        shift = session.shifts(lambda slot: slot.test.name)[:, 3 * k : 3 * k + 3]
        covariance += both_um2 * 1e-6 * shift @ shift.T
    design = np.column_stack([session.kinematic, signature])
    prior = np.diag([FREE_MM**-2] * 24 + [0.0])
    normal = design.T @ np.linalg.solve(covariance, design) + prior
    expected = 1.0 / np.sqrt(np.linalg.inv(normal)[-1, -1])
    limits = Limits(session, noise, rate_hz)
    assert limits.sigmas(signature) == pytest.approx(expected, rel=1e-4)
    # Four times the samples, or half the noise: twice as far out of it. Holders and bar do not average.
    assert expected < Limits(session, noise, 4 * rate_hz).sigmas(signature) < 2.001 * expected


def test_another_effect_fitted_too_takes_its_part(session: LinearSession) -> None:
    limits = Limits(session, Noise(), 20.0)
    signature = session.signature([Gravity(1e-6)])
    assert limits.sigmas(signature, 3.0 * signature[:, None]) < 1e-3 * limits.sigmas(signature)
    steps = session.by_strut(Backlash())
    assert 0.5 * limits.sigmas(signature) < limits.sigmas(signature, steps) <= limits.sigmas(signature)


def test_runs_without_angles_are_early_or_late_where_sampling_is_coarse() -> None:
    circumstances = drawn(np.random.default_rng(5), 5)
    linear = LinearSession(circumstances.scene(), 60)
    base = [circumstances.kinematics]
    signature = linear.signature([Gravity(1e-6)])

    def sigmas(rate_hz: float, *, angles: bool) -> float:
        return Limits(linear, Noise(), rate_hz, base, angles=angles).sigmas(signature)

    assert sigmas(5.0, angles=False) < sigmas(5.0, angles=True)
    assert sigmas(250.0, angles=False) == pytest.approx(sigmas(250.0, angles=True), rel=0.01)
    late = linear.change(TimeSkew(1.0), base)
    assert Limits(linear, Noise(), 25.0, base, angles=False).sigmas(late) < 1e-2
    assert Limits(linear, Noise(), 25.0, base).sigmas(late) > 0.1


@pytest.mark.parametrize("name", [*LISTED, *UNLISTED])
def test_every_effect_can_be_drawn_and_grows_with_its_scale(name: str, session: LinearSession) -> None:
    effect = {**LISTED, **UNLISTED}[name](np.random.default_rng(4), session.scene)
    assert effect.name == name
    assert np.abs(effect.direction).max() == pytest.approx(1.0)
    assert effect.at(1.0).listed == (name in LISTED)
    carriers = effect.carried_by()
    small, large = (session.change(effect.at(share * effect.most), carriers) for share in (0.001, 0.002))
    if name not in {"time-skew", "bar-cyclic"}:  # nothing changes along the circles of a perfect machine
        assert np.abs(small).max() > 0
        np.testing.assert_allclose(large, 2.0 * small, atol=0.02 * np.abs(large).max())


def test_sizes_are_what_was_asked_for(session: LinearSession) -> None:
    del session
    rng = np.random.default_rng(12)
    hider = Hider(rng, drawn(rng, 12))
    single = hider.single("backlash")[0].answer
    assert single["name"] == "backlash"
    assert 1.0 <= single["size"] <= 10.0
    assert single["size_with_all_amplitudes_free"] <= single["size"] * (1 + 1e-6)
    assert single["unconcealed_rms_um"] <= single["signature_rms_um"]
    for hidden in hider.several(2):
        assert hidden.answer["testable"]
    outside = hider.outside("lobed-socket")[0].answer
    assert not outside["listed"]
    assert outside["size"] >= 1.0
    assert outside["nearest"] in families(LinearSession(scene_of(table_ii_plan()), 8))
    for name in CONCEALED:
        faint = hider.concealed(name)[0].answer
        assert not faint["testable"]
        assert 0.0 < faint["size"] <= 0.5 + 1e-9


def test_counts_and_names_in_turn() -> None:
    counts = {
        "clean": 3,
        "single": 50,
        "pair": 2,
        "outside": 12,
        "concealed": 7,
        "triple": 4,
        "faint": 26,
        "disturbed": 12,
    }
    planned = tasks(counts, 1)
    assert [task.number for task in planned] == list(range(1, 117))
    kinds = [task.kind for task in planned]
    assert {kind: kinds.count(kind) for kind in KINDS} == counts
    assert {task.name for task in planned if task.kind == "single"} == set(SINGLE)
    assert {task.name for task in planned if task.kind == "faint"} == set(SINGLE)
    assert {task.name for task in planned if task.kind == "outside"} == set(UNLISTED)
    assert {task.name for task in planned if task.kind == "disturbed"} == set(DISTURBANCES)
    # The order says nothing.
    assert kinds != sorted(kinds, key=KINDS.index)


def test_a_share_of_the_sessions_is_perturbed() -> None:
    counts = {"single": 400}
    assert not any(task.perturbed for task in tasks(counts, 1))
    assert all(task.perturbed for task in tasks(counts, 1, 1.0))
    some = tasks(counts, 1, 0.3)
    assert 90 <= sum(task.perturbed for task in some) <= 150
    # Nothing else changes with it.
    assert [(task.kind, task.name) for task in some] == [(task.kind, task.name) for task in tasks(counts, 1)]


def test_three_effects_are_each_seen_beside_the_two_others() -> None:
    """Every size is that of a fit which has all amplitudes of the two others, too."""
    rng = np.random.default_rng(14)
    circumstances = drawn(rng, 14)
    hider = Hider(rng, circumstances)
    found = hider.several(3)
    assert len({hidden.effect.name for hidden in found}) == 3
    session = LinearSession(circumstances.scene())
    base = [circumstances.kinematics]
    limits = Limits(session, circumstances.noise, circumstances.rate_hz, base, angles=circumstances.angles)

    def column(hidden: Hidden, amplitudes: np.ndarray) -> np.ndarray:
        step = 1e-3 * hidden.effect.most
        return session.change(hidden.effect.make(step * amplitudes), [*base, *hidden.effect.carried_by()]) / step

    for hidden in found:
        others = [
            column(other, sign * row)
            for other in found
            if other is not hidden
            for sign, row in zip(other.effect.signs(), np.eye(len(other.effect.direction)), strict=True)
        ]
        own = column(hidden, hidden.scale * hidden.effect.direction)
        assert hidden.answer["size"] * 5.0 == pytest.approx(limits.sigmas(own, np.stack(others, axis=1)), rel=1e-6)
        assert hidden.answer["size"] >= 1.0 - 1e-9


@pytest.mark.parametrize("name", ["gravity", pytest.param("backlash", marks=pytest.mark.nightly)])
def test_faint_effects_are_three_to_seven_standard_deviations_out(name: str) -> None:
    counts = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        faint, *beside = Hider(rng, drawn(rng, seed)).faint(name)
        assert faint.effect.name == name
        assert 3.0 <= 5.0 * faint.answer["size"] <= 7.0
        assert all(loud.answer["testable"] for loud in beside)
        counts.append(len(beside))
    assert set(counts) == {0, 1}


@pytest.mark.parametrize("name", DISTURBANCES)
def test_a_disturbance_is_hidden_beside_an_effect_of_the_list(name: str) -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        listed, beside = Hider(rng, drawn(rng, seed)).disturbed(name)
        assert listed.answer["listed"]
        assert listed.answer["size"] >= 1.0 - 1e-9
        if beside.answer["disturbance"] == name:
            assert beside.answer["size"] >= 1.0 - 1e-9
            assert beside.answer["name"] == NAME_ON_THE_LIST.get(name, name)
            assert beside.answer["listed"] == (name in NAME_ON_THE_LIST)
            return
    raise AssertionError(f"no {name} shows in six sessions")


def test_a_perturbed_session_says_how_far_it_is_off_the_laws(tmp_path: FilePath) -> None:
    exact, off = (make_session(tmp_path / str(p), 8, Task(3, "single", "gravity", perturbed=p)) for p in (False, True))
    assert (exact["perturbed"], off["perturbed"]) == (False, True)
    told = off["effects"][0]["deviation"]
    assert 0.01 <= told["size"] <= 0.04
    assert told["forms"] == ["strut", "load"]
    assert 0.2 < told["signature_share"] / told["size"] < 3.0
    assert told["sigmas_beside_the_law"] > 0.0
    # All else is the same: the size, the machine, the noise.
    assert {**off["effects"][0], "deviation": None} == {**exact["effects"][0], "deviation": None}
    assert off["circumstances"] == exact["circumstances"]
    runs = [sorted((tmp_path / str(p) / "0003" / "runs").iterdir()) for p in (False, True)]
    readings = [np.loadtxt(run[0], delimiter=",", comments=["#", "t_s"], usecols=1) for run in runs]
    assert 0.0 < np.abs(readings[1] - readings[0]).max() < 0.05


def test_the_same_seed_makes_the_same_session(tmp_path: FilePath) -> None:
    task = Task(3, "single", "gravity")
    answers = [make_session(tmp_path / name, 8, task) for name in ("1", "2")]
    assert json.dumps(answers[0], default=str) == json.dumps(answers[1], default=str)
    for file in (tmp_path / "1").rglob("*.*"):
        assert file.read_bytes() == (tmp_path / "2" / file.relative_to(tmp_path / "1")).read_bytes()


def test_a_study_is_sessions_and_one_file_of_answers(tmp_path: FilePath) -> None:
    counts = {"clean": 1, "single": 1, "pair": 0, "outside": 0, "concealed": 0}
    told: list[int] = []
    sealed = make_study(tmp_path / "study", counts, 2, 1, told.append)
    assert told == [1, 2]
    answers = json.loads(sealed.read_text())
    assert answers["format"] == "blind-answers/1"
    assert sorted(path.name for path in (tmp_path / "study").iterdir()) == ["0001", "0002", "answers.json"]
    hidden = next(answer for answer in answers["sessions"] if answer["kind"] == "single")
    told_text = (tmp_path / "study" / hidden["session"] / "session.yaml").read_text()
    assert hidden["effects"][0]["name"] not in told_text
