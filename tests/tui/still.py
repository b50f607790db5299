"""A still picture of a screen after events, for documentation and tests."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from dbbstation.tui.app import DARK, StationApp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.service.board import SequenceOpened
    from dbbstation.station.commands import Command
    from dbbstation.station.events import Event
    from dbbstation.tui.board_screen import Shown


_ROUNDS = 4


class Happened:
    """A runner for which everything has happened."""

    alive = False
    crash: Exception | None = None

    def __init__(self, events: Sequence[Event | SequenceOpened]) -> None:
        self.sent: list[Command] = []
        self._events = list(events)

    def start(self) -> None:
        """Do nothing."""

    def wait(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def send(self, command: Command) -> bool:
        self.sent.append(command)
        return False

    def mail(self) -> list[Event | SequenceOpened]:
        events, self._events = self._events, []
        return events


async def still_svg(
    shown: Shown,
    events: Sequence[Event | SequenceOpened],
    *,
    size: tuple[int, int] = (120, 40),
    theme: str = DARK,
    press: Sequence[str] = (),
) -> str:
    """Return the screen after these events as SVG."""
    app = StationApp(shown, Happened(events), clock=lambda: 0.0)
    async with app.run_test(size=size) as pilot:
        app.theme = theme
        app.look()
        if press:
            await pilot.press(*press)
        # Once for the parts, once for heights that follow their text, once for what was drawn for other heights.
        for _ in range(_ROUNDS):
            laid_out = asyncio.Event()
            app.call_after_refresh(laid_out.set)
            await laid_out.wait()
            app.draw()
        return app.export_screenshot(title="dbbstation measure")
