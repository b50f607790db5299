"""What is typed while `measure` waits for a verdict."""

from __future__ import annotations

import io

from dbbstation.cli.measure_talk import Keyboard
from dbbstation.plan.plan import Direction
from dbbstation.quality.finding import Name, found
from dbbstation.station import events
from dbbstation.station.commands import Accept, Command, Quit, Repeat
from dbbstation.station.states import State

WRONG = found(Name.FEED, 100.0, 10.0, "", "the feed", "feed 1100 of 1000 mm/min")
SOUND = found(Name.FEED, 1.0, 10.0, "", "the feed")


def sent(typed: str, *, wrong: bool) -> list[Command]:
    """Commands that lines of input become while a run waits for its verdict."""
    commands: list[Command] = []
    keyboard = Keyboard(commands.append, io.StringIO(typed))
    run = events.RunId("a", Direction.CCW, 1, 1)
    keyboard(events.RunCompleted(run, 100, 0, None, "", (WRONG if wrong else SOUND,)))
    keyboard(events.StateChanged(State.COMPLETE, frozenset({Accept, Repeat})))
    keyboard._listen()
    return commands


def test_what_is_wrong_is_accepted_for_a_reason_only() -> None:
    assert sent("\n", wrong=True) == [Repeat(), Quit()]
    assert sent("a\n", wrong=True) == [Quit()]
    assert sent("a the machine is to be seen as it is\n", wrong=True) == [
        Accept("the machine is to be seen as it is"),
        Quit(),
    ]
    assert sent("\n", wrong=False) == [Accept(), Quit()]
    assert sent("a\n", wrong=False) == [Accept(), Quit()]
