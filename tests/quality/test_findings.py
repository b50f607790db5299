"""Findings of runs that were spoilt by a known amount, and of runs that were not."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.plan.plan import Circle, Direction
from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Others, Run, seen
from dbbstation.quality.limits import (
    FALSE_ALARMS_PER_RUN,
    SHARE,
    TESTED,
    joined,
    length_limit,
    length_quantile,
    quantile,
    scale_of,
    scaled_length_quantile,
)
from dbbstation.quality.single import feed
from tests.cli.conftest import call
from tests.quality.sessions import finding_of, read, sound
from tests.quality.shares import spoil
from tests.quality.spoilers import SPOILERS, mirrored

USUAL = {Name.NOISE, Name.DRIFT, Name.SPIKE, Name.DIRECTION, Name.RADIUS, Name.OTHER_DIRECTION}
"""Findings whose limits are tried by default: of one run, of its place, and beside another run. The others are nightly."""


@pytest.fixture
def machine_session(modelled):
    return modelled


def label(whole, name):
    return next(k for k, one in enumerate(whole.runs) if one.run.label == name)


@pytest.mark.slow
def test_sound_runs_have_no_findings(machine_session):
    assert [f"{j.run.label}: {f.text}" for j in machine_session.judged() for f in j.wrong] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in USUAL else pytest.mark.nightly) for n in SPOILERS])
def test_half_of_a_limit_is_kept_and_twice_is_found(machine_session, name):
    found = {one.share: one for one in spoil(machine_session, label(machine_session, "h ccw 2"), name, (0.5, 2.0))}
    assert found[0.5].verdict is not FindingVerdict.WRONG
    assert found[2.0].verdict is FindingVerdict.WRONG
    assert found[2.0].value == pytest.approx(2.0 * found[2.0].limit, rel=0.05)


@pytest.mark.slow
def test_a_bump_of_sixty_micrometres_is_found_anywhere(machine_session):
    k = label(machine_session, "d cw 1")
    one = machine_session.runs[k].run
    for at_deg in range(15, 346, 30):
        spoilt = SPOILERS[Name.BUMP](one.recording, one.circle, 60.0, float(at_deg))
        assert finding_of(machine_session.with_spoilt(k, spoilt), Name.BUMP).verdict is FindingVerdict.WRONG, at_deg


def test_a_circle_that_is_three_tenths_too_large_is_found_without_a_model(tmp_path):
    whole = sound(tmp_path / "a", 5, "af")
    one = whole.runs[0].run
    judged = whole.with_spoilt(0, replace(one.recording, length_mm=one.recording.length_mm + 0.3))
    assert {Name.RADIUS} <= {finding.name for finding in judged.wrong}


@pytest.mark.slow
def test_a_circle_that_was_run_the_wrong_way_is_found_by_the_other_direction(machine_session):
    k = label(machine_session, "f ccw 1")
    one = replace(machine_session.runs[k].run, expected=None)
    across = machine_session.runs[k].coefficients_um[4]
    assert abs(across) > 5.0, "this machine's circle f lies on the axis through its start: take another seed"
    spoilt = seen(replace(one, recording=mirrored(one.recording, one.circle, 1.0)))
    judged = SessionRuns([*machine_session.runs[:k], spoilt, *machine_session.runs[k + 1 :]]).judge(spoilt)
    assert finding_of(judged, Name.DIRECTION).verdict is FindingVerdict.WRONG


@pytest.mark.slow
def test_a_wrong_way_is_found_by_the_model_alone(machine_session):
    k = label(machine_session, "f ccw 1")
    one = machine_session.runs[k].run
    # A model that knows this centre to a tenth of its distance from the axis.
    known_mm = 0.1 * abs(one.expected.centre_mm[1])
    covariance = one.expected.covariance_mm2 * known_mm**2 / one.expected.covariance_mm2[1, 1]
    known = replace(one, expected=replace(one.expected, covariance_mm2=covariance))
    alone = SessionRuns([]).judge(seen(known))
    assert finding_of(alone, Name.DIRECTION).verdict is FindingVerdict.GOOD
    back = SessionRuns([]).judge(seen(replace(known, recording=mirrored(one.recording, one.circle, 1.0))))
    assert finding_of(back, Name.DIRECTION).verdict is FindingVerdict.WRONG


@pytest.mark.slow
def test_a_circle_that_lies_on_the_axis_through_its_start_does_not_show_its_direction(machine_session):
    k = label(machine_session, "a ccw 1")
    one = replace(machine_session.runs[k].run, expected=None)
    alone = SessionRuns([]).judge(seen(one))
    found = finding_of(alone, Name.DIRECTION)
    assert found.verdict is FindingVerdict.CANNOT_TELL
    assert "cannot be seen" in found.text


@pytest.mark.slow
def test_a_recording_without_a_circle_has_that_as_its_finding(machine_session):
    one = machine_session.runs[0].run
    half = len(one.recording) // 2
    cut_off = replace(one.recording, t_s=one.recording.t_s[:half], length_mm=one.recording.length_mm[:half])
    judged = SessionRuns(machine_session.runs).judge(seen(replace(one, recording=cut_off)))
    assert judged.analysis is None
    assert judged.wrong[0].name is Name.CIRCLE
    assert "feed-out" in judged.wrong[0].text


@pytest.mark.slow
def test_nothing_known_means_cannot_tell(machine_session):
    one = machine_session.runs[0].run
    bare = Run(one.test, 1, "m", one.circle, one.recording, None, 0.5)
    verdicts = {f.name: f.verdict for f in SessionRuns([]).judge(seen(bare)).findings}
    for name in (Name.NOISE, Name.RADIUS, Name.BORE, Name.OTHER_DIRECTION, Name.REPEAT, Name.DIRECTION):
        assert verdicts[name] is FindingVerdict.CANNOT_TELL
    assert set(verdicts) == set(Name) - {Name.CIRCLE, Name.SINCE}  # no session came before


def test_the_probability_is_shared_out():
    assert pytest.approx(FALSE_ALARMS_PER_RUN) == SHARE * TESTED
    # 1e-4 of a normal distribution lies beyond 3.8906 standard deviations.
    assert quantile(np.inf, 1e-4) == pytest.approx(3.8906, abs=1e-4)
    assert quantile(4, 0.05) == pytest.approx(2.776, abs=1e-3)
    assert length_quantile(2) == pytest.approx(np.sqrt(-2.0 * np.log(SHARE)))
    # Of one freedom it is the normal distribution; less than one counts as one.
    assert (
        scaled_length_quantile(0.5)
        == scaled_length_quantile(1.0)
        == pytest.approx(NormalDist().inv_cdf(1.0 - 0.5 * SHARE))
    )


def test_the_limit_of_the_feed_is_that_of_the_longest_turn_that_passes():
    """Found by halving: the feed that is missing after the shortest time that is judged wrong."""
    circle = Circle((0, 0, 0), (0, 0, 0), 150, (0, 0, 0), 1000, 0, 45, 1.5, 0, Direction.CCW)

    def judged(longer_s):
        return feed(SimpleNamespace(feed_mm_min=None, longer_s=longer_s, run=SimpleNamespace(circle=circle)), Others())

    passes, wrong = 0.0, 1000.0
    for _ in range(60):
        middle = 0.5 * (passes + wrong)
        passes, wrong = (passes, middle) if judged(middle).verdict is FindingVerdict.WRONG else (middle, wrong)
    assert judged(wrong).value == pytest.approx(judged(wrong).limit)
    assert judged(900.0).limit == judged(wrong).limit


def test_scatter_is_known_whatever_one_of_thirty_does():
    rng = np.random.default_rng(4)
    sizes = [scale_of([*rng.normal(0.0, 2.0, 30), 1000.0])[0] for _ in range(300)]
    assert np.mean(sizes) == pytest.approx(2.0, rel=0.1)
    assert joined([(3.0, 10.0), (4.0, 1e9)]) == pytest.approx((5.0, 5.0**4 / (3.0**4 / 10.0)), rel=1e-3)


def test_lengths_pass_their_limit_as_seldom_as_stated():
    rng = np.random.default_rng(9)
    passed = 0
    for _ in range(4000):
        lengths = np.linalg.norm(rng.normal(0.0, 1.0, (21, 3)), axis=1)
        passed += lengths[0] > length_limit(list(lengths[1:]), 3)
    # SHARE of 4000 is 0.36; eight or more has a probability below 1e-8.
    assert passed < 8


@pytest.mark.slow
def test_directions_are_those_of_the_circles(machine_session):
    session = SessionRuns(machine_session.runs)
    for one in machine_session.runs:
        other = session._opposite(one)
        assert other.run.mounting == one.run.mounting
        assert {one.run.circle.direction, other.run.circle.direction} == set(Direction)


@pytest.mark.nightly
def test_two_hundred_sound_circles(tmp_path):
    """One in a thousand is stated: of two hundred, three or more have a probability of 0.1 %."""
    judged = [j for seed in range(1, 7) for j in sound(tmp_path / str(seed), seed).judged()][:200]
    assert len(judged) == 200
    assert sum(bool(j.wrong) for j in judged) <= 2


@pytest.mark.parametrize("samples", [36, 720])
def test_computed_recordings_without_noise_have_no_findings(tmp_path, samples):
    model = shipped_folder("fixtures") / "models" / "small.yaml"
    plan = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"
    outcome = call("simulate", "--model", model, plan, "--out", tmp_path / "computed", "--samples", samples)
    assert outcome.code == 0, outcome.err
    assert [f"{j.run.label}: {f.text}" for j in read(tmp_path / "computed").judged() for f in j.wrong] == []
