"""`python -m studies history`, in little."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.history.run_length import chart_for
from studies import history
from studies.history import Size, stated_share
from tests.cli.conftest import call
from tests.once import computed_once


@pytest.fixture(autouse=True)
def study_kept(tmp_path_factory, monkeypatch):
    """Both tests look at one study."""
    computed_once(tmp_path_factory, monkeypatch, "studies.history.study")


def test_the_stated_share_is_nearly_that_of_a_constant_rate():
    chart = chart_for(1e-3 / 50)
    assert stated_share(chart, 50, 510) == pytest.approx(1.0 - np.exp(-0.5), abs=0.01)


def test_a_small_study_finds_what_is_large():
    found = history.study(Size(tables=20, quantities=2, sessions=60, false_alarms=1e-3, changes=10, seed=3))
    delays = {(d["way"], d["change"], d["sessions_before"]): d for d in found["delays"]}
    assert delays["as it is", "step of 10", 200]["found"] == 1.0
    assert delays["as it is", "step of 10", 200]["median_delay"] <= 2.0
    few = {one["sessions"]: one for one in found["few_sessions"]}
    assert few[8]["found_by_step"]["20"] == few[2]["found_by_step"]["20"] == 1.0
    assert few[8]["found_by_step"]["3"] < 0.6
    assert {one["scatter_in_u"] for one in found["false_alarms"]} == {0.5, 1.0, 1.5, 4.0}


def test_the_command_prints_both_tables():
    outcome = call(
        "study", "history", "--tables", 20, "--quantities", 2, "--sessions", 60, "--changes", 10, "--seed", 3
    )
    assert outcome.code == 0, outcome.err
    assert "sessions scatter by" in outcome.out
    assert "as it is" in outcome.out
