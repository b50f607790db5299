"""Verdicts on names that may only make up for each other."""

from __future__ import annotations

import pytest

from dbbstation.diagnosis.findings import SourceFinding, Unexplained, Verdict
from dbbstation.diagnosis.verdicts import doubted
from dbbstation.sources.registry import known_sources

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
