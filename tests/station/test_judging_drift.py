"""A bar that wanders makes no right circle wrong."""

from __future__ import annotations

import pytest

from dbbstation.files.recordings.session import read_session
from dbbstation.quality.finding import FindingVerdict
from dbbstation.station.events import RunAccepted, RunId
from tests.plant.mechanisms.disturbances import WanderingBar
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record
from tests.station.judged import judge_of


@pytest.mark.parametrize("seed", [1, 2])
def test_a_wandering_bar_makes_no_right_circle_wrong(tmp_path, seed: int) -> None:
    """Its random walk leaves 0.4 µm a circle and 2 µm a session, some forty times the noise of a mean reading."""
    mechanisms = [RandomKinematics(), WanderingBar(step_um_root_s=0.05)]
    plan = subset(table_ii_plan(seed), "abdfhjkn")
    record(tmp_path / "session", seed=seed, plan=plan, rate_hz=25.0, mechanisms=mechanisms)
    session = read_session(tmp_path / "session")
    judge = judge_of(session)
    for entry in session.runs:
        run = RunId(entry.test, entry.direction, entry.repeat, entry.mounting or 0)
        findings = judge.judge(run, session.load(entry).recording)
        assert [each.text for each in findings if each.verdict is FindingVerdict.WRONG] == []
        judge(RunAccepted(run))
    assert judge.doubted() == {}
