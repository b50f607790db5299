"""The app on a sequence that is only made up."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from dbbstation.station.commands import Quit
from dbbstation.station.states import State
from dbbstation.tui.app import StationApp
from tests.tui.happenings import Happening

if TYPE_CHECKING:
    from dbbstation.service.board import SequenceOpened
    from dbbstation.station.commands import Command
    from dbbstation.station.events import Event


class EndsWhileItsMailIsTaken:
    """A sequence that, told to quit, sends its last events just after the mailbox was emptied, and is over."""

    crash: Exception | None = None

    def __init__(self, before: list[Event | SequenceOpened], last: list[Event | SequenceOpened]) -> None:
        self.alive = True
        self._mail = before
        self._last = last
        self._quits = False

    def start(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def send(self, command: Command) -> bool:
        """Take the command to quit."""
        self._quits = self._quits or isinstance(command, Quit)
        return True

    def mail(self) -> list[Event | SequenceOpened]:
        """Return what there is; the end comes right after it."""
        came, self._mail = self._mail, []
        if self._quits and self.alive:
            self._mail, self.alive = self._last, False
        return came


def test_what_a_sequence_says_last_is_shown_before_the_screen_closes() -> None:
    happening = Happening()
    told = len(happening.events)
    happening.command(Quit())
    runner = EndsWhileItsMailIsTaken(list(happening.events[:told]), list(happening.events[told:]))
    app = StationApp(happening.shown(), runner, clock=lambda: 0.0)

    async def quit_it() -> None:
        async with app.run_test() as pilot:
            app.look()
            assert app.board.state is State.ANNOUNCED
            app.leave(sure=True)
            await pilot.pause(0.5)

    asyncio.run(quit_it())
    assert app.board.state is State.STOPPED
