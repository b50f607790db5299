"""Opening instrument and session for a sequence, each time anew."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from dbbstation.instrument.driver import Instrument
from dbbstation.service.patience import RECONNECT_S, driver_patience
from dbbstation.service.runner import OpenStation
from dbbstation.station.assembly import assemble

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.protocol import Protocol
    from dbbstation.service.runner import Opener
    from dbbstation.station.assembly import Job
    from dbbstation.station.events import Observer


def opener(
    job: Job,
    protocol: Protocol,
    port: str,
    *,
    baud: int | None = None,
    observers: Sequence[Observer] = (),
    time_scale: float = 1.0,
    log: ByteLog | None = None,
) -> Opener:
    """Return what opens instrument and session, each time anew.

    Args:
        job: what is measured.
        protocol: of the instrument.
        port: where it is.
        baud: where it is not set to the usual rate.
        observers: told of everything after storage, before the screen.
        time_scale: of the job's clock.
        log: where every byte is written down.
    """

    @contextmanager
    def opened() -> Iterator[OpenStation]:
        patience = driver_patience(time_scale)
        with Instrument(
            protocol, port, baud=baud, clock=job.clock, log=log, reconnect_s=RECONNECT_S, **patience
        ) as source:
            workplace = assemble(job, source, source.unreadable, asked=protocol.ask.asked)
            for observer in observers:
                workplace.station.subscribe(observer)
            try:
                yield OpenStation(workplace.station, workplace.schedule, str(job.folder), workplace.judge.known())
            finally:
                workplace.close()

    return opened
