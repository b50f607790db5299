"""States of the sequencer and the transitions between them, as one table."""

from __future__ import annotations

from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.station.commands import (
    Accept,
    Command,
    GoTo,
    Judge,
    Note,
    Pause,
    Quit,
    Reject,
    Repeat,
    Resume,
    Skip,
    Start,
)

if TYPE_CHECKING:
    from collections.abc import Mapping


class State(StrEnum):
    """Where the sequence stands; the text is what people read."""

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


class Cause(StrEnum):
    """Why a state changes: commands first, then what the readings, the schedule or the equipment bring."""

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


_ALWAYS = {Cause.QUIT: State.STOPPED, Cause.FAILED: State.FAULTED}
_GIVEN_UP = {Cause.REPEAT: State.BETWEEN, Cause.REJECT: State.BETWEEN}
_OTHER_RUN = {Cause.GO_TO: State.BETWEEN, Cause.JUDGE: State.BETWEEN, Cause.PAUSE: State.PAUSED}

_WAYS: Mapping[State, Mapping[Cause, State]] = MappingProxyType(
    {
        State.BETWEEN: {
            Cause.RUN_LEFT: State.ANNOUNCED,
            Cause.NONE_LEFT: State.FINISHED,
            # A run that was recorded before, and was not judged.
            Cause.CIRCLE_FOUND: State.COMPLETE,
            Cause.CIRCLE_MISSING: State.FLAWED,
        }
        | _ALWAYS,
        State.ANNOUNCED: {Cause.START: State.ARMED, Cause.SKIP: State.BETWEEN} | _OTHER_RUN | _ALWAYS,
        State.ARMED: {
            Cause.BAR_OUTSIDE: State.DWELLING,
            Cause.REPEAT: State.BETWEEN,
            Cause.SKIP: State.BETWEEN,
            Cause.LATE: State.BETWEEN,
        }
        | _OTHER_RUN
        | _ALWAYS,
        State.DWELLING: {Cause.FED_IN: State.TURNING, Cause.LATE: State.FLAWED} | _GIVEN_UP | _ALWAYS,
        State.TURNING: {Cause.FED_OUT: State.LEAVING, Cause.LENGTH_GONE: State.FLAWED, Cause.LATE: State.FLAWED}
        | _GIVEN_UP
        | _ALWAYS,
        State.LEAVING: {Cause.CIRCLE_FOUND: State.COMPLETE, Cause.CIRCLE_MISSING: State.FLAWED} | _GIVEN_UP | _ALWAYS,
        State.COMPLETE: {Cause.ACCEPT: State.BETWEEN} | _GIVEN_UP | _ALWAYS,
        State.FLAWED: _GIVEN_UP | _ALWAYS,
        State.PAUSED: {Cause.RESUME: State.BETWEEN} | _ALWAYS,
        State.FINISHED: {},
        State.STOPPED: {},
        State.FAULTED: {},
    }
)
"""Where causes lead that change the state."""

TRANSITIONS: Mapping[State, Mapping[Cause, State]] = MappingProxyType(
    {state: {**ways, Cause.NOTE: state} if ways else ways for state, ways in _WAYS.items()}
)
"""To which state a cause leads from each state; what does not stand here does not happen. A note changes nothing."""

RECORDING = frozenset({State.DWELLING, State.TURNING, State.LEAVING})
"""States in which every reading is written down."""

VERDICT = frozenset({State.COMPLETE, State.FLAWED})
"""A run has ended and waits for what somebody decides about it."""

FINAL = frozenset(state for state, ways in TRANSITIONS.items() if not ways)
"""States that nothing leads out of."""

COMMAND_CAUSES: Mapping[type[Command], Cause] = MappingProxyType(
    {
        Start: Cause.START,
        Accept: Cause.ACCEPT,
        Repeat: Cause.REPEAT,
        Reject: Cause.REJECT,
        Skip: Cause.SKIP,
        Quit: Cause.QUIT,
        GoTo: Cause.GO_TO,
        Judge: Cause.JUDGE,
        Note: Cause.NOTE,
        Pause: Cause.PAUSE,
        Resume: Cause.RESUME,
    }
)
"""What each command is in the table."""


def commands_allowed(state: State) -> frozenset[type[Command]]:
    """Return the commands that a state takes."""
    return frozenset(command for command, cause in COMMAND_CAUSES.items() if cause in TRANSITIONS[state])
