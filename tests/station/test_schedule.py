from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.recordings.entries import RunEntry, RunState
from dbbstation.plan.circle import Direction
from dbbstation.plan.plan import Plan
from dbbstation.station.schedule import NextRun, Schedule

CCW, CW = Direction.CCW, Direction.CW


@pytest.fixture
def plan(plan_file: Path) -> Plan:
    return read_plan(plan_file)


def entry(test: str, direction: Direction, *, mounting: int | None = 1, accepted: bool = True) -> RunEntry:
    return RunEntry(
        test=test,
        direction=direction,
        repeat=1,
        mounting=mounting,
        state=RunState.ACCEPTED if accepted else RunState.RECORDING,
        reason="",
        started=datetime(2026, 11, 20, tzinfo=UTC),
        path=Path("runs/x.csv"),
        sha256="",
        program=None,
        centre_mm=None,
    )


def following(plan: Plan, *recorded: RunEntry) -> NextRun:
    found = Schedule(plan, lambda *_: 1 + len(recorded), recorded).next()
    assert found is not None
    return found


def test_the_order_is_that_of_the_plan_with_repeats_at_its_end(plan: Plan) -> None:
    texts = [task.text for task in Schedule(plan, lambda *_: 1).tasks]
    assert texts == ["a ccw", "a cw", "b ccw", "b cw", "a ccw (repeated at the end)", "a cw (repeated at the end)"]


def test_a_session_goes_on_with_the_first_run_that_lacks_an_accepted_recording(plan: Plan) -> None:
    here = following(plan, entry("a", CCW), entry("a", CW, accepted=False))
    assert (here.run.test, here.run.direction, here.run.repeat, here.number) == ("a", CW, 3, 2)


def test_the_ball_that_stood_last_stands_still(plan: Plan) -> None:
    assert following(plan, entry("a", CCW)).put_up is False
    here = following(plan, entry("a", CCW), entry("a", CW), entry("b", CCW, mounting=2))
    assert (here.run.mounting, here.put_up) == (2, False)


def test_where_nobody_noted_the_mounting_the_ball_is_put_up_anew(plan: Plan) -> None:
    here = following(plan, entry("a", CCW), entry("a", CW, mounting=None, accepted=False))
    assert (here.run.mounting, here.put_up) == (2, True)


def test_accepted_runs_count_for_the_repeats_at_the_end_as_well(plan: Plan) -> None:
    done = [entry("a", CCW), entry("a", CW), entry("b", CCW, mounting=2), entry("b", CW, mounting=2)]
    here = following(plan, *done)
    assert (here.run.test, here.number, here.run.mounting, here.put_up) == ("a", 5, 3, True)
    schedule = Schedule(plan, lambda *_: 1, [*done, entry("a", CCW, mounting=3), entry("a", CW, mounting=3)])
    assert (schedule.next(), schedule.accepted, schedule.open) == (None, 6, ())


def test_more_accepted_runs_than_planned_do_no_harm(plan: Plan) -> None:
    schedule = Schedule(plan, lambda *_: 1, [entry("b", CCW)] * 3)
    assert schedule.accepted == 1


def test_two_tests_at_one_ball_share_its_mounting(plan: Plan) -> None:
    test = plan.tests["a"]
    both = Plan("both", {"a": test, "raised": replace(test, name="raised")})
    schedule = Schedule(both, lambda *_: 1)
    for _ in range(2):
        found = schedule.next()
        assert found is not None
        schedule.accept(schedule.mounted(found.run, remounted=False))
    found = schedule.next()
    assert found is not None
    assert (found.run.test, found.run.mounting, found.put_up) == ("raised", 1, False)
