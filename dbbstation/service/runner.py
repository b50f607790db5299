"""Run the sequence in a thread; the screen polls its mailbox."""

from __future__ import annotations

import queue
import threading
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.errors import StationError
from dbbstation.service.board import SequenceOpened
from dbbstation.station.assembly import assemble
from dbbstation.station.commands import Quit
from dbbstation.station.events import Event, Fault, ReadingsSeen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from contextlib import AbstractContextManager

    from dbbstation.service.held_line import HeldLine
    from dbbstation.station.assembly import Job
    from dbbstation.station.commands import Command
    from dbbstation.station.engine import Station
    from dbbstation.station.events import Observer

_JOIN_S = 10.0
"""Longest wait for a hanging serial line when the screen closes [s]."""


Opener: TypeAlias = "Callable[[], AbstractContextManager[tuple[Station, SequenceOpened]]]"
"""Function that borrows the instrument and opens the session. It is called again when a failed line is connected
again."""


class Runner:
    """Runs one sequence after another.

    Args:
        opener: called in the runner's thread.

    Attributes:
        crash: programming error that ended the thread.
    """

    def __init__(self, opener: Opener, line: HeldLine | None = None) -> None:
        self._opener = opener
        self._line = line
        self._mail: queue.SimpleQueue[Event | SequenceOpened] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._station: Station | None = None
        self._told = False
        self._closing = threading.Event()
        self.crash: Exception | None = None

    @property
    def alive(self) -> bool:
        """Return whether a sequence is running."""
        return self._thread is not None and self._thread.is_alive()

    def start(self) -> None:
        """Open instrument and session and run, unless running."""
        if self.alive:
            return
        self._told = False
        self._thread = threading.Thread(target=self._run, name="station", daemon=True)
        self._thread.start()

    def send(self, command: Command) -> bool:
        """Send a command; return whether it was taken."""
        station = self._station
        if station is None:
            return False
        station.send(command)
        return True

    def mail(self) -> list[Event | SequenceOpened]:
        """Return events since the last call."""
        over = not self.alive  # asked first: what the sequence sent last comes before what is only seen
        came: list[Event | SequenceOpened] = []
        with suppress(queue.Empty):
            while True:
                came.append(self._mail.get_nowait())
        seen = () if self._line is None else self._line.seen()
        if over and seen:
            came.append(ReadingsSeen(seen))
        return came

    def wait(self) -> None:
        """Wait until an ended sequence has released the session."""
        if self._thread is not None:
            self._thread.join(_JOIN_S)

    def close(self) -> None:
        """End any sequence and wait."""
        self._closing.set()
        self.send(Quit())
        self.wait()

    def _run(self) -> None:
        try:
            with self._opener() as (station, opened):
                self._mail.put(opened)
                station.subscribe(self._observe)
                self._station = station
                if self._closing.is_set():
                    station.send(Quit())
                station.run()
        except StationError as error:
            # What the engine ran into it has told already; what kept it from beginning it could not.
            if not self._told:
                self._mail.put(Fault(error, None))
        except Exception as error:  # noqa: BLE001 - raised again where it can be seen, when the screen has closed
            self.crash = error
        finally:
            self._station = None

    def _observe(self, event: Event) -> None:
        self._told = self._told or isinstance(event, Fault)
        self._mail.put(event)


def opener(job: Job, line: HeldLine, *, observers: Sequence[Observer] = ()) -> Opener:
    """Return a function that borrows the instrument and opens the session again."""

    @contextmanager
    def opened() -> Iterator[tuple[Station, SequenceOpened]]:
        with line.lent() as source:
            workplace = assemble(job, source, source.unreadable, asked=line.protocol.ask.asked)
            for observer in observers:
                workplace.station.subscribe(observer)
            try:
                virtual = workplace.writer.session.virtual is True
                known, schedule = workplace.judge.known(), workplace.schedule
                yield workplace.station, SequenceOpened(schedule.tasks, schedule.open, str(job.folder), known, virtual)
            finally:
                workplace.close()

    return opened
