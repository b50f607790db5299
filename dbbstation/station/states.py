"""States of the sequencer and their transitions, as one table."""

from __future__ import annotations

from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, get_args

from dbbstation.station.commands import Command

if TYPE_CHECKING:
    from collections.abc import Mapping


class State(StrEnum):
    """State of the sequence; the value is text for people."""

    BETWEEN = "between runs"
    ANNOUNCED = "waiting for the set-up"
    ARMED = "waiting for the bar at the feed-in point"
    DWELLING = "waiting for the feed-in"
    TURNING = "on the circle"
    LEAVING = "feeding out"
    COMPLETE = "waiting for a verdict"
    FLAWED = "no usable circle"
    PAUSED = "paused"
    FINISHED = "finished"
    STOPPED = "stopped"
    FAULTED = "stopped by a fault"


class Trigger(StrEnum):
    """Causes of a change: commands, then readings, schedule or equipment."""

    START = "start"
    ACCEPT = "accept"
    REPEAT = "repeat"
    REJECT = "reject"
    SKIP = "skip"
    QUIT = "quit"
    GO_TO = "go to"
    JUDGE = "judge"
    NOTE = "note"
    PAUSE = "pause"
    RESUME = "resume"

    RUN_LEFT = "a run is left to do"
    NONE_LEFT = "no run is left to do"
    BAR_OUTSIDE = "the bar stands outside the circle"
    FED_IN = "the bar fed in"
    FED_OUT = "the bar fed out"
    CIRCLE_FOUND = "the recording holds the circle"
    CIRCLE_MISSING = "the recording does not hold the circle"
    LENGTH_GONE = "the instrument has no length on the circle"
    LATE = "what was waited for did not come in time"
    FAILED = "instrument or storage failed"


_ALWAYS = {Trigger.QUIT: State.STOPPED, Trigger.FAILED: State.FAULTED}
_GIVEN_UP = {Trigger.REPEAT: State.BETWEEN, Trigger.REJECT: State.BETWEEN}
_OTHER_RUN = {Trigger.GO_TO: State.BETWEEN, Trigger.JUDGE: State.BETWEEN, Trigger.PAUSE: State.PAUSED}

_WAYS: Mapping[State, Mapping[Trigger, State]] = {
    State.BETWEEN: {
        Trigger.RUN_LEFT: State.ANNOUNCED,
        Trigger.NONE_LEFT: State.FINISHED,
        # A run that was recorded before, and was not judged.
        Trigger.CIRCLE_FOUND: State.COMPLETE,
        Trigger.CIRCLE_MISSING: State.FLAWED,
    }
    | _ALWAYS,
    State.ANNOUNCED: {Trigger.START: State.ARMED, Trigger.SKIP: State.BETWEEN} | _OTHER_RUN | _ALWAYS,
    State.ARMED: {
        Trigger.BAR_OUTSIDE: State.DWELLING,
        Trigger.REPEAT: State.BETWEEN,
        Trigger.SKIP: State.BETWEEN,
        Trigger.LATE: State.BETWEEN,
    }
    | _OTHER_RUN
    | _ALWAYS,
    State.DWELLING: {Trigger.FED_IN: State.TURNING, Trigger.LATE: State.FLAWED} | _GIVEN_UP | _ALWAYS,
    State.TURNING: {Trigger.FED_OUT: State.LEAVING, Trigger.LENGTH_GONE: State.FLAWED, Trigger.LATE: State.FLAWED}
    | _GIVEN_UP
    | _ALWAYS,
    State.LEAVING: {Trigger.CIRCLE_FOUND: State.COMPLETE, Trigger.CIRCLE_MISSING: State.FLAWED} | _GIVEN_UP | _ALWAYS,
    State.COMPLETE: {Trigger.ACCEPT: State.BETWEEN} | _GIVEN_UP | _ALWAYS,
    State.FLAWED: _GIVEN_UP | _ALWAYS,
    State.PAUSED: {Trigger.RESUME: State.BETWEEN} | _ALWAYS,
    State.FINISHED: {},
    State.STOPPED: {},
    State.FAULTED: {},
}
"""New state for each trigger that changes the state."""

TRANSITIONS: Mapping[State, Mapping[Trigger, State]] = MappingProxyType(
    {state: {**ways, Trigger.NOTE: state} if ways else ways for state, ways in _WAYS.items()}
)
"""New state for each state and trigger; other triggers are refused. A note changes no state."""

RECORDING = frozenset({State.DWELLING, State.TURNING, State.LEAVING})
"""States in which every reading is recorded."""

VERDICT = frozenset({State.COMPLETE, State.FLAWED})
"""States in which a finished run awaits a decision."""

FINAL = frozenset(state for state, ways in TRANSITIONS.items() if not ways)
"""States that cannot be left."""

COMMAND_CAUSES: Mapping[type[Command], Trigger] = dict(zip(get_args(Command), Trigger, strict=False))
"""The trigger of each command."""


def commands_allowed(state: State) -> frozenset[type[Command]]:
    """Return the commands that a state allows."""
    return frozenset(command for command, cause in COMMAND_CAUSES.items() if cause in TRANSITIONS[state])
