"""The engine: one loop that carries readings and commands to the sequencer and its events to whoever subscribed."""

from __future__ import annotations

import queue
import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Protocol

from dbbstation.errors import StationError
from dbbstation.station.events import Event, Fault
from dbbstation.station.states import FINAL, State

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.instrument.reading import Reading
    from dbbstation.station.commands import Command
    from dbbstation.station.events import Observer
    from dbbstation.station.sequencer import Sequencer

_TICK_S = 0.005
"""Real time between looks at an instrument that has nothing new; a command wakes the loop at once."""


class ReadingSource(Protocol):
    """What the engine needs of an instrument; the driver is one."""

    def drain(self) -> Sequence[Reading]:
        """Return what has come since the last call, without waiting.

        Raises:
            StationError: the line failed, after everything before it was returned.
        """


class Station:
    """Runs a sequence to its end.

    `send` may be called from any thread. Observers are called one after the other, in the order they subscribed, in the
    thread of `run`; storage subscribes first, so that nobody is told of what is not kept.

    Args:
        sequencer: not yet begun.
        source: started instrument.
    """

    def __init__(self, sequencer: Sequencer, source: ReadingSource) -> None:
        self._sequencer = sequencer
        self._source = source
        self._commands: queue.SimpleQueue[Command] = queue.SimpleQueue()
        self._observers: list[Observer] = []
        self._wake = threading.Event()

    @property
    def state(self) -> State:
        """Where the sequence stands."""
        return self._sequencer.state

    def subscribe(self, observer: Observer) -> None:
        """Call `observer` with every event from now on."""
        self._observers.append(observer)

    def send(self, command: Command) -> None:
        """Put a command into the queue; thread-safe, also from a signal handler."""
        self._commands.put(command)
        self._wake.set()

    def run(self) -> State:
        """Run until the sequence is finished or stopped; return the state it ended in.

        Raises:
            StationError: instrument or storage failed; observers were told of it with a `Fault` before.
        """
        try:
            self._publish(self._sequencer.begin())
            while self.state not in FINAL:
                if not self._step():
                    self._wake.wait(_TICK_S)
                self._wake.clear()
        except StationError as error:
            self._tell_of(error)
            raise
        return self.state

    def _step(self) -> bool:
        """Carry what has come; return whether there was anything."""
        busy = False
        with suppress(queue.Empty):
            while self.state not in FINAL:
                command = self._commands.get_nowait()
                busy = True
                self._publish(self._sequencer.command(command))
        if self.state in FINAL:
            return busy
        readings = self._source.drain()
        if readings:
            self._publish(self._sequencer.readings(readings))
        return busy or bool(readings)

    def _publish(self, events: Sequence[Event]) -> None:
        for event in events:
            for observer in self._observers:
                observer(event)

    def _tell_of(self, error: StationError) -> None:
        """Tell everybody of a failure, also when an observer was its cause; what fails now only adds to it."""
        for event in self._sequencer.fail(error):
            for observer in self._observers:
                try:
                    observer(event)
                except StationError as further:
                    if isinstance(event, Fault):
                        error.add_note(str(further))
