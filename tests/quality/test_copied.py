"""Readings that stand in two runs: copies are found, and two runs of one circle are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from dbbstation.circles.analysis import analyse
from dbbstation.quality.copied import copied
from dbbstation.quality.finding import FindingVerdict, Name
from dbbstation.quality.knowledge import seen
from tests.quality.sessions import finding_of, judged, run, sound
from tests.quality.spoilers import longer


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return sound(tmp_path_factory.mktemp("copied") / "session", 6, "af")


def copy(one, *, of, rows=slice(None)):
    recording = replace(of.run.recording, t_s=of.run.recording.t_s[rows], length_mm=of.run.recording.length_mm[rows])
    return seen(replace(one.run, recording=replace(recording, t_s=recording.t_s - recording.t_s[0])))


def test_two_runs_of_one_circle_have_noise_of_their_own(whole):
    for one in whole.runs:
        found = copied(one, [other for other in whole.runs if other is not one])
        assert found.verdict is FindingVerdict.GOOD, one.run.label
        assert found.value == 0.0
        assert 0.0 < found.limit < 5.0


@pytest.mark.parametrize("dropped", [0, 7])
def test_a_run_that_came_in_twice_is_found(whole, dropped):
    first, second, again = run(whole, "a ccw 1"), run(whole, "a cw 1"), run(whole, "a ccw 2")
    for one, of in ((again, first), (second, first)):
        found = finding_of(
            judged([first, run(whole, "f ccw 1")], copy(one, of=of, rows=slice(dropped, None))), Name.COPIED
        )
        assert found.verdict is FindingVerdict.WRONG
        assert found.value > 90.0
        assert found.short.endswith("run a ccw 1")


def test_a_stretch_that_was_copied_is_found(whole):
    first, again = run(whole, "a ccw 1"), run(whole, "a ccw 2")
    length = again.run.recording.length_mm.copy()
    length[1000:1270] = first.run.recording.length_mm[1000:1270]
    mixed = seen(replace(again.run, recording=replace(again.run.recording, length_mm=length)))
    found = copied(mixed, [first])
    assert found.verdict is FindingVerdict.WRONG
    assert found.value == pytest.approx(10.0, abs=2.0)


def test_readings_in_steps_that_are_not_finer_than_the_noise_say_nothing(whole):
    first, again = run(whole, "a ccw 1"), run(whole, "a ccw 2")
    coarse = [
        seen(replace(one.run, recording=replace(one.run.recording, length_mm=np.round(one.run.recording.length_mm, 2))))
        for one in (first, again)
    ]
    assert copied(coarse[0], coarse[1:]).verdict is FindingVerdict.CANNOT_TELL


@pytest.mark.parametrize("step_um", [0.1, 0.2, 0.5])
def test_chance_makes_no_copy_of_equal_forms(whole, step_um):
    """One form, noise of its own in each of twenty runs: none has a stretch of another, whatever the step."""
    one = run(whole, "a ccw 1")
    form_mm = np.full(len(one.run.recording), 150.0)
    runs = []
    for seed in range(20):
        noise = 1e-3 * np.random.default_rng(seed).normal(0.0, 0.5, len(form_mm))
        length = 1e-3 * step_um * np.round(1e3 * (form_mm + noise) / step_um)
        raw = replace(one.analysis.raw, length_mm=length[: len(one.analysis.raw)])
        runs.append(replace(one, analysis=replace(one.analysis, raw=raw)))
    for each in runs:
        assert copied(each, [other for other in runs if other is not each]).verdict is FindingVerdict.GOOD


@pytest.mark.parametrize(("noise_um", "step_um"), [(1.0, 0.1), (0.5, 0.2)])
def test_as_many_equal_readings_are_allowed_as_chance_makes(whole, noise_um, step_um):
    """The likeliest reading of a normal noise comes with the probability 2 Phi(step / 2 sigma) - 1; the noise is known to some percent."""
    one = run(whole, "a ccw 1")
    runs = []
    for seed in range(2):
        readings = 150.0 + 1e-3 * np.random.default_rng(seed).normal(0.0, noise_um, len(one.run.recording))
        length = 1e-3 * step_um * np.round(1e3 * readings / step_um)
        raw = replace(one.analysis.raw, length_mm=length[: len(one.analysis.raw)])
        runs.append(replace(one, analysis=analyse(raw)))
    count = len(runs[0].analysis.raw)
    chance = 2.0 * ndtr(0.5 * step_um / noise_um) - 1.0
    in_a_row = np.log(count**2 / 1e-9) / -np.log(chance)
    allowed = copied(runs[0], runs[1:]).limit * count / 100.0
    assert in_a_row <= allowed <= 1.3 * in_a_row + 1.0


def test_a_copy_that_was_moved_is_another_matter(whole):
    first, again = run(whole, "a ccw 1"), run(whole, "a ccw 2")
    moved = seen(replace(again.run, recording=longer(first.run.recording, np.full(len(first.run.recording), 3.0))))
    assert copied(moved, [first]).verdict is FindingVerdict.GOOD
