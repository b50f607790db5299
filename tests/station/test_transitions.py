from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dbbstation.errors import InstrumentError
from dbbstation.files.formats.plan import read_plan
from dbbstation.instrument.reading import Reading
from dbbstation.plan.plan import Direction
from dbbstation.station import events
from dbbstation.station.commands import Accept, AddNote, GoTo, Judge, Pause, Quit, Reject, Repeat, Resume, Skip, Start
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from dbbstation.station.states import COMMAND_CAUSES, FINAL, TRANSITIONS, State, Trigger, commands_allowed
from tests.station.readings import run_readings, still, told_and_untold

if TYPE_CHECKING:
    from pathlib import Path

COMMANDS = [
    Start(),
    Start(remounted=True),
    Accept(),
    Repeat(),
    Reject(),
    Skip(),
    Quit(),
    GoTo("b"),
    GoTo("a", Direction.CW),
    Judge("a", Direction.CCW, 1, accepted=False),
    Judge("a", Direction.CCW, 1, accepted=True),
    AddNote("a draught"),
    AddNote(ambient_temp_c=20.5),
    Pause(),
    Resume(),
]


def test_the_table_has_every_state_and_leads_only_to_states() -> None:
    assert set(TRANSITIONS) == set(State)
    assert {target for ways in TRANSITIONS.values() for target in ways.values()} <= set(State)
    assert {State.FINISHED, State.STOPPED, State.FAULTED} == FINAL


def test_every_state_can_be_reached_and_left_by_quitting_or_failing() -> None:
    reached = {State.BETWEEN}
    while True:
        further = {target for state in reached for target in TRANSITIONS[state].values()}
        if further <= reached:
            break
        reached |= further
    assert reached == set(State)
    for state in set(State) - FINAL:
        assert TRANSITIONS[state][Trigger.QUIT] is State.STOPPED
        assert TRANSITIONS[state][Trigger.FAILED] is State.FAULTED


def test_every_cause_leads_somewhere_and_every_command_is_a_cause() -> None:
    assert {cause for ways in TRANSITIONS.values() for cause in ways} == set(Trigger)
    assert set(COMMAND_CAUSES) == {type(command) for command in COMMANDS}


step = st.one_of(
    st.sampled_from(COMMANDS),
    st.sampled_from(["run", "outside", "inside", "nothing", "part", "fail"]),
    st.tuples(st.floats(0.0, 400.0), st.sampled_from(["ok", "overrange", "fault"])),
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(step, max_size=25))
def test_no_sequence_of_commands_and_readings_leaves_the_table(plan_file: Path, steps: list[object]) -> None:
    plan = read_plan(plan_file)
    told: list[events.Event] = []
    sequencer = Sequencer(plan, Schedule(plan, lambda *_: 1), told_and_untold(told))
    told += sequencer.begin()
    circle = plan.tests["a"].circle
    now_s = 0.0
    for one in steps:
        before = sequencer.state
        if one == "run":
            readings = run_readings(circle, now_s, 5.0)
            now_s = readings[-1].t_s + 1.0
            now = sequencer.readings(readings)
        elif one == "part":
            readings = run_readings(circle, now_s, 5.0)[:200]
            now_s = readings[-1].t_s + 1.0
            now = sequencer.readings(readings)
        elif one in {"outside", "inside", "nothing"}:
            length = {"outside": 151.5, "inside": 150.0, "nothing": None}[str(one)]
            now = sequencer.readings(still(length, 2.0, now_s))
            now_s += 2.0
        elif one == "fail":
            now = sequencer.fail(InstrumentError("gone"))
        elif isinstance(one, tuple):
            now_s += 0.01
            now = sequencer.readings([Reading(now_s, one[0], one[1])])
        else:
            now = sequencer.command(one)  # type: ignore[arg-type]
            refused = any(isinstance(event, events.CommandRefused) for event in now)
            # A verdict on a run that was never recorded is refused in any state.
            assert refused or type(one) in commands_allowed(before)
            assert not refused or isinstance(one, Judge) or type(one) not in commands_allowed(before)
            if refused:
                assert sequencer.state is before
        told += now
        if before in FINAL:
            assert sequencer.state is before
    _check_told(told, sequencer.state)


def _check_told(told: list[events.Event], last: State) -> None:
    """States follow the table; samples belong to a run that has begun and not ended."""
    state, open_run = State.BETWEEN, None
    for event in told:
        if isinstance(event, events.StateChanged):
            assert event.state in TRANSITIONS[state].values()
            assert event.commands == commands_allowed(event.state)
            state = event.state
        elif isinstance(event, events.RunStarted):
            assert open_run is None
            open_run, last_s = event.run, -1.0
        elif isinstance(event, events.SamplesRecorded):
            assert event.run == open_run
            for sample in event.samples:
                assert sample.length_mm is not None
                assert sample.t_s > last_s
                last_s = sample.t_s
        elif isinstance(event, events.RunCompleted):
            assert event.run == open_run
            open_run = None
    assert state is last


@pytest.mark.parametrize("state", sorted(FINAL))
def test_nothing_happens_any_more_in_a_final_state(state: State, plan_file: Path) -> None:
    plan = read_plan(plan_file)
    sequencer = Sequencer(plan, Schedule(plan, lambda *_: 1), told_and_untold([]))
    sequencer.begin()
    sequencer.state = state
    assert sequencer.readings(still(151.5, 1.0)) == []
    assert sequencer.fail(InstrumentError("gone")) == []
    assert [type(event) for event in sequencer.command(Start())] == [events.CommandRefused]
