from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.plan.plan import Direction
from dbbstation.station import events
from dbbstation.station.commands import Accept, AddNote, GoTo, Judge, Pause, Quit, Reject, Repeat, Resume, Skip, Start
from dbbstation.station.detector import Patience
from dbbstation.station.run_record import recording_of
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer, Waiting, instructions
from dbbstation.station.states import State
from tests.station.readings import kinds, run_readings, still

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.instrument.reading import Status
    from dbbstation.plan.plan import Plan


@pytest.fixture
def plan(plan_file: Path) -> Plan:
    return read_plan(plan_file)


def made(plan: Plan, **more: Any) -> Sequencer:
    taken: dict[tuple[str, Direction], int] = {}

    def next_repeat(test: str, direction: Direction) -> int:
        return taken.get((test, direction), 0) + 1

    sequencer = Sequencer(plan, Schedule(plan, next_repeat), recording_of, **more)
    sequencer.taken = taken  # type: ignore[attr-defined]
    return sequencer


def one_run(sequencer: Sequencer, plan: Plan, test: str, direction: Direction) -> list[events.Event]:
    circle = plan.tests[test].run(direction)
    told = sequencer.command(Start()) + sequencer.readings(run_readings(circle))
    taken = sequencer.taken  # type: ignore[attr-defined]
    taken[test, direction] = taken.get((test, direction), 0) + 1
    return told


def test_a_run_is_told_from_announcement_to_verdict(plan: Plan) -> None:
    sequencer = made(plan)
    (announced, changed) = sequencer.begin()
    assert isinstance(announced, events.RunAnnounced)
    assert (announced.run.label, announced.run.mounting, announced.put_up) == ("a-ccw-1", 1, True)
    assert (announced.number, announced.count) == (1, 6)
    assert announced.instructions[0] == "Put the short holder with the ball 9-short into bore 9"
    assert changed == events.StateChanged(State.ANNOUNCED, frozenset({Start, Skip, Quit, GoTo, Judge, AddNote, Pause}))
    told = one_run(sequencer, plan, "a", Direction.CCW)
    assert kinds(told) == ["RunStarted", "FeedInSeen", "RunCompleted"]
    assert [event.state for event in told if isinstance(event, events.StateChanged)] == [
        State.ARMED,
        State.DWELLING,
        State.TURNING,
        State.LEAVING,
        State.COMPLETE,
    ]
    completed = next(event for event in told if isinstance(event, events.RunCompleted))
    assert completed.problem == ""
    assert completed.figures is not None
    assert completed.figures.circularity_um < 0.2
    progress = [event.swept_deg for event in told if isinstance(event, events.RunProgress)]
    assert progress == sorted(progress)
    assert progress[-1] > 445.0
    accepted = sequencer.command(Accept())
    assert kinds(accepted) == ["RunAccepted", "RunAnnounced"]


def test_the_live_angle_is_that_of_the_turn(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    told = one_run(sequencer, plan, "a", Direction.CCW)
    samples = [sample for event in told if isinstance(event, events.SamplesRecorded) for sample in event.samples]
    angles = [sample.phi_deg for sample in samples if sample.phi_deg is not None]
    assert angles[0] == pytest.approx(-45.0, abs=1.0)
    assert angles[-1] == pytest.approx(405.0, abs=0.01)
    middle = samples[len(samples) // 2]
    assert middle.phi_deg == pytest.approx(180.0, abs=3.0)


def test_the_whole_plan_with_its_repeats_and_mountings(plan: Plan) -> None:
    sequencer = made(plan)
    told = sequencer.begin()
    announced = []
    while sequencer.state not in {State.FINISHED, State.FAULTED}:
        here = next(event for event in told if isinstance(event, events.RunAnnounced))
        announced.append((here.run.label, here.run.mounting, here.put_up))
        one_run(sequencer, plan, here.run.test, here.run.direction)
        told = sequencer.command(Accept())
    assert announced == [
        ("a-ccw-1", 1, True),
        ("a-cw-1", 1, False),
        ("b-ccw-1", 2, True),
        ("b-cw-1", 2, False),
        ("a-ccw-2", 3, True),
        ("a-cw-2", 3, False),
    ]
    assert kinds(told) == ["RunAccepted", "SessionFinished"]
    finished = next(event for event in told if isinstance(event, events.SessionFinished))
    assert (finished.accepted, finished.missing) == (6, ())


def test_a_holder_that_was_touched_makes_a_new_mounting(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    one_run(sequencer, plan, "a", Direction.CCW)
    sequencer.command(Accept())
    sequencer.command(Start(remounted=True))
    told = sequencer.readings(run_readings(plan.tests["a"].run(Direction.CW)))
    started = next(event for event in told if isinstance(event, events.RunStarted))
    assert (started.run.label, started.run.mounting) == ("a-cw-1", 2)
    announced = next(event for event in sequencer.command(Accept()) if isinstance(event, events.RunAnnounced))
    assert (announced.run.label, announced.run.mounting) == ("b-ccw-1", 3)


@pytest.mark.parametrize("command", [Repeat("a bump"), Reject("a bump")])
def test_a_run_that_is_thrown_out_is_ended_kept_and_followed(plan: Plan, command: Repeat | Reject) -> None:
    sequencer = made(plan)
    sequencer.begin()
    sequencer.command(Start())
    sequencer.readings(run_readings(plan.tests["a"].circle)[:400])
    assert sequencer.state is State.TURNING
    told = sequencer.command(command)
    assert kinds(told) == ["RunCompleted", "RunRejected", "RunAnnounced"]
    announced = next(event for event in told if isinstance(event, events.RunAnnounced))
    assert announced.run.direction is (Direction.CCW if isinstance(command, Repeat) else Direction.CW)


def test_what_was_left_out_is_named_at_the_end(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    told = []
    for _ in range(6):
        told = sequencer.command(Skip())
    finished = next(event for event in told if isinstance(event, events.SessionFinished))
    assert finished.missing[:2] == ("a ccw", "a cw")
    assert finished.missing[-1] == "a cw (repeated at the end)"


def test_half_a_circle_is_no_circle(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    circle = plan.tests["a"].circle
    run = run_readings(circle)
    broken_off = [replace(reading, length_mm=153.0) for reading in run[700:]]
    told = sequencer.command(Start()) + sequencer.readings(run[:700] + broken_off)
    assert sequencer.state is State.FLAWED
    completed = next(event for event in told if isinstance(event, events.RunCompleted))
    assert completed.figures is None
    assert "degrees lie between feed-in and feed-out" in completed.problem
    assert kinds(sequencer.command(Accept())) == ["CommandRefused"]
    assert kinds(sequencer.command(Repeat())) == ["RunRejected", "RunAnnounced"]


def test_a_machine_that_does_not_come_is_announced_again(plan: Plan) -> None:
    sequencer = made(plan, patience=Patience(for_machine_s=10.0))
    sequencer.begin()
    told = sequencer.command(Start()) + sequencer.readings(still(150.0, 15.0))
    assert kinds(told) == ["FeedInMissed", "RunLate", "RunAnnounced"]
    assert sequencer.state is State.ANNOUNCED
    late = next(event for event in told if isinstance(event, events.RunLate))
    assert "150.750 mm" in late.problem


@pytest.mark.parametrize(
    ("length_mm", "what"), [(151.5, "no feed-in seen"), (150.0, "the length has stood at 150.0000 mm")]
)
def test_a_machine_that_stops_in_the_run_ends_it(plan: Plan, length_mm: float, what: str) -> None:
    sequencer = made(plan, patience=Patience(for_machine_s=10.0))
    sequencer.begin()
    sequencer.command(Start())
    readings = still(151.5, 1.0) + still(length_mm, 300.0, 1.0)
    told = sequencer.readings(readings)
    assert sequencer.state is State.FLAWED
    completed = next(event for event in told if isinstance(event, events.RunCompleted))
    assert what in completed.problem


@pytest.mark.parametrize("status", ["fault", "overrange"])
def test_readings_without_a_length_are_kept_in_the_dwells_and_not_used(plan: Plan, status: Status) -> None:
    sequencer = made(plan)
    sequencer.begin()
    run = run_readings(plan.tests["a"].circle)
    for k in (5, 6, len(run) - 12, len(run) - 11):
        run[k] = replace(run[k], length_mm=None, status=status, said="signal lost")
    told = sequencer.command(Start()) + sequencer.readings(run)
    assert sequencer.state is State.COMPLETE
    samples = [sample for event in told if isinstance(event, events.SamplesRecorded) for sample in event.samples]
    assert [sample.status for sample in samples].count(status) == 4
    assert all(sample.length_mm is not None for sample in samples)


@pytest.mark.parametrize("status", ["fault", "overrange"])
def test_a_reading_without_a_length_on_the_turn_ends_the_run_with_a_message(plan: Plan, status: Status) -> None:
    sequencer = made(plan)
    sequencer.begin()
    run = run_readings(plan.tests["a"].circle)
    run[700] = replace(run[700], status=status, said="signal lost", remedy="seat the bar")
    told = sequencer.command(Start()) + sequencer.readings(run)
    assert sequencer.state is State.FLAWED
    samples = [sample for event in told if isinstance(event, events.SamplesRecorded) for sample in event.samples]
    assert samples[-1].status == status  # it stands in the file, and nothing behind it
    completed = next(event for event in told if isinstance(event, events.RunCompleted))
    phi_deg = samples[-1].phi_deg
    assert phi_deg is not None
    what = f"the instrument reports {status} (signal lost) at {phi_deg:.0f}° of the turn; seat the bar, then repeat the run"
    assert completed.problem == what
    assert kinds(sequencer.command(Repeat())) == ["RunRejected", "RunAnnounced"]


def test_one_misread_line_is_no_movement(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    run = run_readings(plan.tests["a"].circle)
    run[600] = replace(run[600], length_mm=152.0)
    sequencer.command(Start())
    told = sequencer.readings(run[:1200])
    assert sequencer.state is State.TURNING
    assert kinds(told) == ["RunStarted", "FeedInSeen"]


def test_a_fault_names_the_run_that_it_interrupts(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    sequencer.command(Start())
    sequencer.readings(run_readings(plan.tests["a"].circle)[:300])
    told = sequencer.fail(InstrumentError("the line was closed"))
    fault = next(event for event in told if isinstance(event, events.Fault))
    assert fault.interrupted is not None
    assert fault.interrupted.label == "a-ccw-1"
    assert sequencer.state is State.FAULTED


def test_a_ball_under_the_spindle_is_put_up_where_the_machine_stands() -> None:
    plan = read_plan(shipped_folder("protocols") / "plans" / "conventional.yaml")
    test = plan.tests["d"]
    put_up = instructions(test.ball, test.circle, put_up=True, program="")
    assert put_up[0] == (
        "Drive the machine to X 100.000 Y 100.000 Z -1150.000 A -10° B 10° and put the ball d up under the spindle"
    )
    assert "micrometer" in put_up[1]
    assert put_up[2] == "Bar of 150 mm, level; circle about X 100.000 Y 100.000 Z -1150.000"
    stays = instructions(test.ball, test.run(Direction.CW), put_up=False, program="d-cw.ngc")
    assert stays == (
        "Leave the ball d and the moving ball as they stand, do not touch them",
        "Tilt the tool to A -10°, B 10°",
        "Bar of 150 mm, level; circle about X 100.000 Y 100.000 Z -1150.000",
        "Start the NC program d-cw.ngc at 1000 mm/min",
    )


def test_a_start_that_comes_to_nothing_leaves_no_mounting(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    sequencer.command(Start())
    told = sequencer.command(Repeat())
    announced = next(event for event in told if isinstance(event, events.RunAnnounced))
    assert (announced.run.mounting, announced.put_up) == (1, True)
    assert announced.instructions[0] == "Put the short holder with the ball 9-short into bore 9"


def test_start_in_mid_circle_says_that_the_circle_is_missed(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    sequencer.command(Start())
    told = sequencer.readings(run_readings(plan.tests["a"].circle)[500:900])
    (missed,) = [event for event in told if isinstance(event, events.FeedInMissed)]
    assert "this circle is not recorded" in missed.problem
    assert sequencer.state is State.ARMED


def test_a_gauge_that_counts_the_wrong_way_round_is_told_of_while_the_machine_turns(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    sequencer.command(Start())
    circle = plan.tests["a"].circle
    mirrored = [replace(one, length_mm=2.0 * circle.bar_mm - one.length_mm) for one in run_readings(circle)[:900]]
    (missed,) = [one for one in sequencer.readings(mirrored) if isinstance(one, events.FeedInMissed)]
    assert "the gauge counts the wrong way round: turn its counting direction" in missed.problem


def test_a_start_that_was_forgotten_is_told_while_the_machine_turns(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    told = sequencer.readings(run_readings(plan.tests["a"].circle)[:900])
    (missed,) = [event for event in told if isinstance(event, events.FeedInMissed)]
    assert "before Start" in missed.problem
    assert sequencer.state is State.ANNOUNCED
    # A bar that is pushed in by hand, or stands there without having fed in, is no circle.
    other = made(plan)
    other.begin()
    told = other.readings(still(151.5, 3.0) + still(150.0, 1.0, 3.0) + still(140.0, 3.0, 4.0) + still(150.0, 1.0, 7.0))
    assert kinds(told) == []
    assert kinds(other.readings(still(130.0, 5.0, 9.0))) == []


def test_a_run_without_a_verdict_is_offered_again_before_anything_is_measured(plan: Plan) -> None:
    first = made(plan)
    first.begin()
    told = one_run(first, plan, "a", Direction.CCW)
    completed = next(event for event in told if isinstance(event, events.RunCompleted))
    samples = tuple(s for event in told if isinstance(event, events.SamplesRecorded) for s in event.samples)
    for command, following in ((Accept(), "a-cw-1"), (Repeat("no"), "a-ccw-2"), (Reject("no"), "a-cw-1")):
        schedule = Schedule(plan, lambda *run: 2 if run == ("a", Direction.CCW) else 1)
        schedule.recorded(completed.run)
        again = Sequencer(plan, schedule, recording_of, waiting=[Waiting(completed, samples)])
        offered = again.begin()
        assert kinds(offered) == ["RunAnnounced", "RunRestored", "RunCompleted"]
        assert again.state is State.COMPLETE
        announced = next(event for event in again.command(command) if isinstance(event, events.RunAnnounced))
        assert announced.run.label == following
        assert schedule.accepted == isinstance(command, Accept)


def test_a_verdict_is_taken_back_and_the_run_measured_again(plan: Plan) -> None:
    sequencer = made(plan)
    sequencer.begin()
    for direction in (Direction.CCW, Direction.CW):
        one_run(sequencer, plan, "a", direction)
        sequencer.command(Accept())
    told = sequencer.command(Judge("a", Direction.CCW, 1, accepted=False, reason="a bump, seen later"))
    assert kinds(told) == ["RunRejected", "RunAnnounced"]
    announced = next(event for event in told if isinstance(event, events.RunAnnounced))
    assert announced.run.label == "b-ccw-1"  # nobody is sent back at once
    told = sequencer.command(GoTo("a"))
    announced = next(event for event in told if isinstance(event, events.RunAnnounced))
    assert announced.run.label == "a-ccw-2"
    told = sequencer.command(Judge("z", Direction.CCW, 1, accepted=True))
    (refused,) = [event for event in told if isinstance(event, events.CommandRefused)]
    assert refused.why == "no complete recording is called z-ccw-1"
    told = sequencer.command(GoTo("z"))
    (refused,) = [event for event in told if isinstance(event, events.CommandRefused)]
    assert refused.why == "the plan has no test z"


def test_nothing_is_waited_for_in_a_pause(plan: Plan) -> None:
    sequencer = made(plan, patience=Patience(for_machine_s=10.0))
    sequencer.begin()
    sequencer.command(Start())
    sequencer.command(Pause())
    assert kinds(sequencer.readings(still(150.0, 100.0))) == []
    assert sequencer.state is State.PAUSED
    assert kinds(sequencer.command(Resume())) == ["RunAnnounced"]
    assert sequencer.state is State.ANNOUNCED


def test_the_set_up_says_what_the_instrument_is_too_slow_for(plan: Plan) -> None:
    """Two points per undulation; fewer than 36 on a turn are no circle."""
    circle = plan.tests["a"].circle
    turn_s = 360.0 / circle.turning_deg_s
    for points, said in ((1000, ""), (50, "50 points per turn: undulations above 25"), (20, "which is no circle")):
        sequencer = made(plan, rate_hz=points / turn_s)
        announced = next(event for event in sequencer.begin() if isinstance(event, events.RunAnnounced))
        assert announced.sampling is not None
        assert announced.sampling.points_per_turn == pytest.approx(points)
        assert said in announced.instructions[-1]
        assert ("points per turn" in announced.instructions[-1]) == bool(said)
