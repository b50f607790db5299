"""The loop that carries readings and commands to the sequencer, and events to subscribers."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING, Protocol

from dbbstation.errors import StationError
from dbbstation.station.events import Event, Fault
from dbbstation.station.states import FINAL, State

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from dbbstation.instrument.reading import Reading
    from dbbstation.station.commands import Command
    from dbbstation.station.events import Observer
    from dbbstation.station.sequencer import Sequencer

_TICK_S = 0.005
"""Real time between two polls of an instrument without new readings [s]; a command wakes the loop at once."""


class ReadingSource(Protocol):
    """A source of readings, such as the driver."""

    def drain(self) -> Sequence[Reading]:
        """Return new readings without waiting.

        Raises:
            StationError: the line failed, after all earlier readings were returned.
        """


class Station:
    """Runs a sequence to its end."""

    def __init__(self, sequencer: Sequencer, source: ReadingSource) -> None:
        self._sequencer = sequencer
        self._source = source
        self._commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._observers: list[Observer] = []
        self._regular: list[Callable[[], None]] = []

    @property
    def state(self) -> State:
        """Return the state of the sequence."""
        return self._sequencer.state

    def subscribe(self, observer: Observer) -> None:
        """Call `observer` with every event from now on."""
        self._observers.append(observer)

    def regularly(self, duty: Callable[[], None]) -> None:
        """Call `duty` many times a second, with or without readings."""
        self._regular.append(duty)

    def send(self, command: Command) -> None:
        """Queue a command, from any thread or signal handler."""
        self._commands.put(command)

    def run(self) -> State:
        """Run to the end or a stop and return the final state.

        Raises:
            StationError: instrument or storage failed; observers got a `Fault` first.
        """
        try:
            self._publish(self._sequencer.begin())
            idle = False
            while self.state not in FINAL:
                idle = not self._carry_command(wait=idle) and not self._carry_readings()
                for duty in self._regular:
                    duty()
        except StationError as error:
            self._tell_of(error)
            raise
        return self.state

    def _carry_command(self, *, wait: bool) -> bool:
        try:
            command = self._commands.get(block=wait, timeout=_TICK_S)
        except queue.Empty:
            return False
        self._publish(self._sequencer.command(command))
        return True

    def _carry_readings(self) -> bool:
        readings = self._source.drain()
        self._publish(self._sequencer.readings(readings))
        return bool(readings)

    def _publish(self, events: Sequence[Event]) -> None:
        for event in events:
            for observer in self._observers:
                observer(event)

    def _tell_of(self, error: StationError) -> None:
        for event in self._sequencer.fail(error):
            for observer in self._observers:
                try:
                    observer(event)
                except StationError as further:
                    if isinstance(event, Fault):
                        error.add_note(str(further))
