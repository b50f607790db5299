"""Sentences of documents, help and messages do not become harder to read: no habit grows above its stored share."""

from __future__ import annotations

import json

import pytest

from tests.docs.habits import HABITS, LIMITS, habits_of, kinds, sentences_of, shares

ROOM = 0.3
"""Percentage points by which a share may pass its limit: three sentences of a thousand, so that one sentence decides nothing."""

HARD = {
    "what-clause as subject": "What is smaller than that is seen by every user.",
    "things that stand, say, know": "Its number stands in the session file.",
    "private words": "The fit then takes the rest as noise.",
    "none, nobody, nothing": "X and Y have none in this case.",
    "those of, that of": "The option is that of circles.",
    "where for if": "Where one fault is found the file is refused.",
    "opening without a noun": "That needs the text of the standard.",
    "inverted opening": "Of the first ten sessions the scatter is unknown.",
    "over 30 words": "The program " + "really " * 30 + "ends.",
    "two semicolons or colons": "The file has keys; units: they end names; signs.",
}


@pytest.fixture(scope="module")
def found():
    return kinds()


@pytest.mark.parametrize("kind", ["documents", "help", "messages"])
def test_no_habit_grows(kind, found):
    limits, now = json.loads(LIMITS.read_text("utf-8"))[kind], shares(found[kind])
    grown = {habit: (now[habit], limits[habit]) for habit in HABITS if now[habit] > limits[habit] + ROOM}
    assert not grown, "share now and limit [%]; `python -m tests.docs.habits --show HABIT` lists the sentences"


@pytest.mark.parametrize("habit", HABITS)
def test_each_habit_is_seen(habit):
    assert habit in habits_of(HARD[habit])


def test_a_plain_sentence_has_no_habit():
    assert habits_of("The driver keeps a line until it has read the next lines.") == []


def test_code_and_links_count_as_words():
    found = sentences_of("The command [`check`](check.md) reads `what is left` of files. It is short.")
    assert found == ["The command `check` reads `what is left` of files."]
    assert habits_of(found[0]) == []
