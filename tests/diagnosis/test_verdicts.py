"""Verdicts on names that may only make up for each other."""

from __future__ import annotations

import pytest

from dbbstation.diagnosis.findings import SourceFinding, Unexplained, Verdict
from dbbstation.diagnosis.verdicts import doubted
from dbbstation.sources.registry import known_sources, sources_named

NOTHING_LEFT = Unexplained(0.0, None, None, 0.0, "")


def finding(name, gain, verdict=Verdict.IDENTIFIED, alike=()):
    return SourceFinding(name, verdict, alike, gain, 0.9, 1.0, 0.1, {}, "")


def said(findings, rest=NOTHING_LEFT):
    return {f.name: (f.verdict, f.ambiguous_with) for f in doubted(findings, rest, known_sources())}


def test_a_second_warm_up_that_brings_little_may_be_the_second_stage_of_the_first():
    frame, struts = finding("thermal-frame", 620.0), finding("thermal-struts", 79.0)
    assert said([frame, struts]) == {
        "thermal-frame": (Verdict.IDENTIFIED, ()),
        "thermal-struts": (Verdict.AMBIGUOUS, ("thermal-frame",)),
    }


@pytest.mark.parametrize(
    "second",
    [
        finding("thermal-struts", 300.0),
        finding("backlash", 79.0),
        finding("thermal-struts", 0.4, Verdict.AMBIGUOUS, ("thermal-frame",)),
        finding("thermal-struts", -0.2, Verdict.RULED_OUT),
    ],
    ids=["as much", "no warm-up", "a rival only", "ruled out"],
)
def test_what_brings_much_or_is_no_warm_up_or_was_not_needed_stands(second):
    first = finding("thermal-frame", 620.0)
    assert doubted([first, second], NOTHING_LEFT, known_sources()) == (first, second)


def test_names_that_follow_what_is_left_follow_it_in_doubt():
    left = Unexplained(0.3, None, "time", 20.0, "")
    names = said([finding("thermal-frame", 620.0), finding("thermal-struts", 400.0), finding("backlash", 50.0)], left)
    assert names["thermal-frame"] == (Verdict.AMBIGUOUS, ("thermal-struts",))
    assert names["backlash"] == (Verdict.IDENTIFIED, ())


def test_what_brings_very_little_beside_a_rough_law_may_only_make_up_for_it():
    play, runout, joints = finding("play", 583.0), finding("joint-runout", 11.6), finding("platform-joints", 40.0)
    assert said([play, joints, runout]) == {
        "play": (Verdict.IDENTIFIED, ()),
        "platform-joints": (Verdict.IDENTIFIED, ()),
        "joint-runout": (Verdict.AMBIGUOUS, ("play",)),
    }


def test_beside_an_exact_law_and_beside_its_own_rivals_it_stands():
    loud, runout = finding("gravity", 1e6, Verdict.AMBIGUOUS, ("strut-weight",)), finding("servo-lag", 74.0)
    rival = finding("strut-weight", 20.0, Verdict.AMBIGUOUS, ("gravity",))
    assert doubted([loud, runout, rival], NOTHING_LEFT, known_sources()) == (loud, runout, rival)
    friction = finding("joint-friction", 500.0, Verdict.AMBIGUOUS, ("servo-lag",))
    lag = finding("servo-lag", 8.0, Verdict.AMBIGUOUS, ("joint-friction",))
    assert doubted([friction, lag], NOTHING_LEFT, known_sources()) == (friction, lag)


def test_thermometers_that_are_coarse_put_the_others_in_doubt_and_not_what_follows_them():
    left = Unexplained(0.1, 1, "time", 15.0, "")
    (frame,) = sources_named(["thermal-frame"])
    told = doubted(
        [finding("thermal-frame", 140000.0), finding("bar-drift", 27.0), finding("thermal-struts", 17.0)],
        left,
        {**known_sources(), "thermal-frame": frame.by_temperature()},
    )
    assert [f.verdict for f in told] == [Verdict.IDENTIFIED, Verdict.AMBIGUOUS, Verdict.AMBIGUOUS]
    assert all("thermal-frame" in f.ambiguous_with for f in told[1:])
