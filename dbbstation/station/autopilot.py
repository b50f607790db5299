"""Mount, start and accept runs without a person, for virtual machines and tests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from dbbstation.errors import TraceError
from dbbstation.station import events
from dbbstation.station.commands import Accept, Repeat, Start
from dbbstation.station.states import State

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.plan.plan import Direction
    from dbbstation.station.commands import Command

MOST_REPEATS = 2
"""Greatest number of repetitions of a run without a usable circle: a third failure has a cause."""


class Hands(Protocol):
    """Interface that moves the machine and mounts balls."""

    def stands_since_s(self) -> float:
        """Return the machine time at which the machine stopped to wait [s]; minus infinity if it never waits."""

    def standing(self) -> str | None:
        """Return the name of the mounted ball."""

    def mount(self, test: str) -> None:
        """Put up the ball of a test."""

    def start(self, test: str, direction: Direction, program: str) -> None:
        """Start a circle, by its NC program if one is named."""


class Autopilot:
    """Drives a sequence to its end; an observer of the station."""

    def __init__(self, send: Callable[[Command], None], hands: Hands) -> None:
        self._send = send
        self._hands = hands
        self._announced: events.RunAnnounced | None = None
        self._problem = ""
        self._failed = 0

    def __call__(self, event: events.Event) -> None:
        """Act on the event.

        Raises:
            TraceError: a run keeps failing, or the machine does not come.
            StationError: the machine refuses.
        """
        match event:
            case events.RunAnnounced():
                self._announced = event
            case events.RunCompleted():
                self._problem = event.problem
            case events.RunAccepted():
                self._failed = 0
            case events.RunLate():
                raise TraceError(event.problem, where=f"run {event.run.label}")
            case events.StateChanged():
                self._act(event.state)
            case _:
                pass

    def _prepare(self, announced: events.RunAnnounced) -> None:
        remounted = False
        if announced.put_up:
            self._hands.mount(announced.run.test)
        elif self._hands.standing() != announced.ball.name:
            # Another program put something else up since: whatever stands there next is a new mounting.
            self._hands.mount(announced.run.test)
            remounted = True
        self._send(Start(remounted=remounted, after_s=self._hands.stands_since_s()))

    def _act(self, state: State) -> None:
        if self._announced is None:
            return
        run = self._announced.run
        if state is State.ANNOUNCED:
            self._prepare(self._announced)
        elif state is State.ARMED:
            self._hands.start(run.test, run.direction, self._announced.program)
        elif state is State.COMPLETE:
            self._send(Accept())
        elif state is State.FLAWED:
            self._failed += 1
            if self._failed > MOST_REPEATS:
                raise TraceError(self._problem, where=f"run {run.label}, for the {self._failed}. time")
            self._send(Repeat(self._problem))
