"""One word on a run: what it is where nothing is wrong, and which cause comes first where something is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dbbstation.quality.answer import DO, EXPLAINS, SHOWN_BY, Advice, answer
from dbbstation.quality.finding import Finding, FindingVerdict, Name, found, undecided
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import seen
from tests.quality.spoilers import at_feed, bumpy, drifting, elsewhere, mirrored


@pytest.fixture
def whole(four_tests):
    return four_tests


def answered(whole, label, spoiler=None, *sizes):
    at = next(k for k, one in enumerate(whole.runs) if one.run.label == label)
    one = whole.runs[at]
    if spoiler is not None:
        one = seen(replace(one.run, recording=spoiler(one.run.recording, one.run.circle, *sizes)))
    judged = SessionRuns([*whole.runs[:at], one]).judge(one)
    return answer(judged.findings, one.problem)


def test_every_finding_has_its_place_and_what_to_do():
    ranked = [name for names in EXPLAINS for name in names]
    assert sorted(ranked) == sorted(Name)
    assert set(DO) | {Name.CIRCLE} == set(Name)
    assert set().union(*SHOWN_BY.values()) <= set(Name)


def test_a_first_circle_is_good_only_as_far_as_can_be_seen(whole):
    first = answered(whole, "a ccw 1")
    assert (first.word, first.causes) == (Advice.CANNOT_TELL, ())
    assert first.unseen == (
        "whether it is the circle of another test",
        "whether it ran the wrong way round",
        "whether the ball stands where it stood",
    )
    # The other direction will tell the last; test a alone does not know how large this machine's errors are.
    assert answered(whole, "b ccw 1").unseen == (
        "whether it ran the wrong way round",
        "whether the ball stands where it stood",
    )
    assert answered(whole, "b cw 1").word is Advice.GOOD
    decided = [Finding(name, 0.0, 1.0, "µm", FindingVerdict.GOOD, "") for name in Name]
    assert answer(decided).word is Advice.GOOD
    assert answer([one for one in decided if one.name is not Name.DIRECTION]).unseen == (
        "whether it ran the wrong way round",
    )
    no_repeat = [one for one in decided if one.name is not Name.REPEAT]
    assert answer([*no_repeat, undecided(Name.REPEAT, "no earlier run")]).word is Advice.GOOD


@pytest.mark.parametrize(
    ("spoiler", "sizes", "begins"),
    [
        (at_feed, (100.0,), "feed 1099 of 1000 mm/min: set the override on the control to 100 %"),
        (elsewhere, (500.0,), "other direction "),
        (bumpy, (60.0,), "bump +"),
        (drifting, (400.0,), "closure "),
        (mirrored, (1.0,), "direction "),
    ],
)
def test_the_cause_that_explains_the_others_comes_first(whole, spoiler, sizes, begins):
    found_ = answered(whole, "b cw 1", spoiler, *sizes)
    assert found_.word is Advice.REPEAT
    assert found_.causes[0].startswith(begins), found_.causes


def test_a_recording_without_a_circle_is_repeated():
    assert answer((), "no feed-out seen").causes == ("no feed-out seen",)
    assert answer((), "no feed-out seen").word is Advice.REPEAT
    assert answer(()).word is Advice.CANNOT_TELL  # nothing was looked for
    wrong = found(Name.LOST, 3.0, 0.5, "", "lost")
    assert answer([wrong]).causes == (f"lost samples 3.00 of 0.50 %: {DO[Name.LOST]}",)
