"""Answers of two checkouts held against each other: what counts as a difference, and the whole command on a small case."""

from __future__ import annotations

import json
import sys

import pytest

from benchmarks import answers
from benchmarks.answers import ROOT, cases, differences


def found(old, new, relative=1e-6):
    return list(differences(old, new, relative))


def test_numbers_are_alike_within_the_tolerance_and_words_only_if_equal():
    assert found({"a": 1.0, "verdict": "identified"}, {"a": 1.0 + 1e-7, "verdict": "identified"}) == []
    assert found({"a": 1.0}, {"a": 1.0 + 2e-6}) == [("a", 1.0, 1.0 + 2e-6)]
    assert found({"verdict": "identified"}, {"verdict": "not-testable"}) == [("verdict", "identified", "not-testable")]
    assert found({"ok": True}, {"ok": 1.5}) == [("ok", True, 1.5)]


def test_objects_of_a_list_are_matched_by_name_and_what_came_or_went_is_said():
    old = [{"name": "gravity", "u": 1.0}, {"name": "play", "u": 2.0}]
    new = [{"name": "play", "u": 2.5}, {"name": "gravity", "u": 1.0}, {"name": "drift", "u": 3.0}]
    assert found({"sources": old}, {"sources": new}) == [
        ("sources[play].u", 2.0, 2.5),
        ("sources[drift]", "-", {"name": "drift", "u": 3.0}),
    ]
    assert found([1.0, 2.0], [1.0]) == [("[1]", 2.0, "-")]


def test_when_and_by_what_it_was_computed_is_no_answer():
    assert (
        found({"provenance": {"program": "1"}, "seconds": 1.0}, {"provenance": {"program": "2"}, "seconds": 2.0}) == []
    )


def test_cases_reach_recordings_made_elsewhere(tmp_path):
    (tmp_path / "loads.csv").write_text("# a comment\nt_s,measured_n,simulated_n\n0,1,2\n", encoding="utf-8")
    own, more = cases(ROOT, None), cases(ROOT, tmp_path)
    assert "diagnose small" in own
    assert own["mismatch axis"][:2] == ("mismatch", "fixtures/tables/axis.csv")
    assert set(more) - set(own) == {"mismatch loads"}
    assert more["mismatch loads"][2:6] == ("--measured", "measured_n", "--simulated", "simulated_n")


def test_the_command_finds_none_in_equal_answers_then_says_a_planted_one(tmp_path, monkeypatch, capsys):
    commits = {("rev-parse", "--short=8", "v1"): "11111111", ("rev-parse", "--short=8", "HEAD"): "22222222"}
    monkeypatch.setattr(answers, "_git", lambda *words: commits.get(words, ""))
    monkeypatch.setattr(sys, "argv", ["answers.py", "v1", "--only", "instruments", "--keep", str(tmp_path)])
    # The other checkout is this one under another name: nothing differs.
    (tmp_path / "checkouts").mkdir()
    (tmp_path / "checkouts" / "11111111").symlink_to(answers.ROOT)
    with pytest.raises(SystemExit) as left:
        answers.main()
    assert (left.value.code, capsys.readouterr().out) == (0, "0 differences in 0 of 1 cases\n")
    kept = tmp_path / "11111111" / "instruments.json"
    told = json.loads(kept.read_text(encoding="utf-8"))
    assert told["exit_code"] == 0
    kept.write_text(json.dumps({**told, "exit_code": 7}), encoding="utf-8")
    with pytest.raises(SystemExit) as left:
        answers.main()
    assert left.value.code == 1
    assert "instruments: exit_code: 7 -> 0" in capsys.readouterr().out
