"""A small blind study: sessions drawn by chance in which something is hidden, judged with every source as candidate.

It is nightly: clean sessions, and effects alone and three at a time, are in CI one by one. The large one, with its table, is in
docs/blind.md. What holds there in 19 of 20 sessions is asked here of most: the sessions are drawn anew whenever the generator
changes, and nobody has looked at them before.
"""

from __future__ import annotations

import pytest

from dbbstation.sources.registry import known_sources
from dbbstation.tasks.diagnosed import default_candidates
from studies.blind import judge_sessions, read_answers
from studies.blind_score import numbers, score
from tests.plant.blind.sessions import make_study

SMALL = {"clean": 1, "single": 3, "concealed": 1}
LARGER = {"clean": 3, "single": 6, "pair": 1, "outside": 1, "concealed": 1}


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((SMALL, 2027), marks=pytest.mark.nightly),
        pytest.param((LARGER, 2026), marks=pytest.mark.nightly),
    ],
    ids=["small", "larger"],
)
def study(request, tmp_path_factory):
    """How many sessions of each kind there are, and what became of them."""
    counts, seed = request.param
    folder = tmp_path_factory.mktemp("hidden")
    make_study(folder, counts, seed=seed, jobs=1, told=lambda _: None)
    verdicts = judge_sessions(folder, default_candidates(known_sources()), 1, lambda *_: None)
    return counts, score(read_answers(folder), verdicts)


@pytest.fixture(scope="module")
def outcomes(study):
    return study[1]


def of_kind(outcomes, kind):
    return [outcome for outcome in outcomes if outcome.kind == kind]


def test_every_session_has_a_diagnosis(study):
    counts, outcomes = study
    assert len(outcomes) == sum(counts.values())
    assert [outcome.error for outcome in outcomes if outcome.error] == []


def test_clean_sessions_raise_no_alarm(outcomes):
    assert [outcome.said for outcome in of_kind(outcomes, "clean") if not outcome.right] == []


def test_single_effects_are_detected_and_hardly_ever_called_something_else(outcomes):
    single = of_kind(outcomes, "single")
    assert sum(outcome.detected for outcome in single) >= len(single) - 1
    assert sum(outcome.within for outcome in single) >= len(single) - 1
    assert sum(bool(outcome.wrong) for outcome in single) <= 1


def test_nothing_is_claimed_that_cannot_be_seen(outcomes):
    assert all(outcome.quiet for outcome in of_kind(outcomes, "concealed"))


def test_the_table_counts_what_was_judged(study):
    counts, outcomes = study
    table = numbers(outcomes)
    assert table["sessions"] == len(outcomes)
    assert table["shares"]["clean: false alarm"]["count"] == counts["clean"]
    assert table["shares"]["single: detected"]["count"] == counts["single"]
