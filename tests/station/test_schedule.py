from __future__ import annotations

from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dbbstation.files.formats.plan import read_plan
from dbbstation.files.formats.session import RunEntry, RunState
from dbbstation.plan.plan import Direction, Plan
from dbbstation.station.schedule import NextRun, Schedule

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.station.events import RunId

CCW, CW = Direction.CCW, Direction.CW


@pytest.fixture
def plan(plan_file: Path) -> Plan:
    return read_plan(plan_file)


def entry(
    test: str, direction: Direction, *, repeat: int = 1, mounting: int | None = 1, accepted: bool = True
) -> RunEntry:
    return RunEntry(
        test=test,
        direction=direction,
        repeat=repeat,
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
    schedule = Schedule(
        plan, lambda *_: 1, [*done, entry("a", CCW, repeat=2, mounting=3), entry("a", CW, repeat=2, mounting=3)]
    )
    assert (schedule.next(), schedule.accepted, schedule.open) == (None, 6, ())


def test_more_accepted_runs_than_planned_do_no_harm(plan: Plan) -> None:
    schedule = Schedule(plan, lambda *_: 1, [entry("b", CCW, repeat=repeat) for repeat in (1, 2, 3)])
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


def ran(schedule: Schedule) -> RunId:
    found = schedule.next()
    assert found is not None
    run = schedule.mounted(found.run, remounted=False)
    schedule.recorded(run)
    schedule.accept(run)
    return run


def labels(schedule: Schedule, count: int) -> list[str]:
    return [f"{run.test}-{run.direction}" for run in (ran(schedule) for _ in range(count))]


def repeats() -> Callable[[str, Direction], int]:
    taken: Counter[tuple[str, Direction]] = Counter()

    def following(test: str, direction: Direction) -> int:
        taken[test, direction] += 1
        return taken[test, direction]

    return following


def test_one_goes_to_a_test_and_on_from_there_and_what_was_left_out_comes_at_the_end(plan: Plan) -> None:
    schedule = Schedule(plan, repeats())
    schedule.go_to("b")
    assert labels(schedule, 6) == ["b-ccw", "b-cw", "a-ccw", "a-cw", "a-ccw", "a-cw"]
    assert schedule.open == ()


def test_a_direction_can_be_gone_to_alone(plan: Plan) -> None:
    schedule = Schedule(plan, repeats())
    schedule.go_to("a", CW)
    assert labels(schedule, 3) == ["a-cw", "b-ccw", "b-cw"]


def test_what_was_left_out_is_measured_when_one_goes_there(plan: Plan) -> None:
    schedule = Schedule(plan, repeats())
    for _ in range(6):
        found = schedule.next()
        assert found is not None
        schedule.pass_over(found.run)
    assert schedule.next() is None
    schedule.go_to("b")
    assert labels(schedule, 2) == ["b-ccw", "b-cw"]
    assert schedule.next() is None


def test_a_test_that_is_done_can_be_measured_once_more(plan: Plan) -> None:
    schedule = Schedule(plan, repeats())
    labels(schedule, 4)
    schedule.go_to("b", CW)
    assert labels(schedule, 2) == ["b-cw", "a-ccw"]


def test_a_verdict_that_is_taken_back_leaves_its_task_open(plan: Plan) -> None:
    schedule = Schedule(plan, repeats())
    first = ran(schedule)
    labels(schedule, 2)
    schedule.judge(first.test, first.direction, first.repeat, accepted=False)
    assert schedule.open[0].text == "a ccw"
    assert schedule.accepted == 2
    schedule.judge(first.test, first.direction, first.repeat, accepted=True)
    assert schedule.accepted == 3
    with pytest.raises(KeyError):
        schedule.judge("a", CCW, 9, accepted=True)
    with pytest.raises(KeyError):
        schedule.go_to("z")


def test_a_session_goes_on_where_it_stood_though_runs_were_left_out_before(plan: Plan) -> None:
    here = following(plan, entry("a", CCW), entry("b", CCW, mounting=2, accepted=False))
    assert (here.run.test, here.run.direction) == ("b", CCW)
