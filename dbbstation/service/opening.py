"""Open the session again for each sequence, while the instrument stays open."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.service.runner import OpenStation
from dbbstation.station.assembly import assemble

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.service.held_line import HeldLine
    from dbbstation.service.runner import Opener
    from dbbstation.station.assembly import Job
    from dbbstation.station.events import Observer


def opener(job: Job, line: HeldLine, *, observers: Sequence[Observer] = ()) -> Opener:
    """Return a function that borrows the instrument and opens the session again."""

    @contextmanager
    def opened() -> Iterator[OpenStation]:
        with line.lent() as source:
            workplace = assemble(job, source, source.unreadable, asked=line.protocol.ask.asked)
            for observer in observers:
                workplace.station.subscribe(observer)
            try:
                virtual = workplace.writer.session.virtual is True
                known = workplace.judge.known()
                yield OpenStation(workplace.station, workplace.schedule, str(job.folder), known, virtual)
            finally:
                workplace.close()

    return opened
