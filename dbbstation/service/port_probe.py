"""Probe a port for one reading."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.errors import StationError
from dbbstation.instrument.driver import Instrument
from dbbstation.instrument.link import connected_ports

if TYPE_CHECKING:
    from dbbstation.instrument.protocol import Protocol

PATIENCE_S = 4.0
"""Longest wait for a reading [s]: a display answers within a tenth of a second, and a stream needs no request."""

_LOOK_S = 0.02


@dataclass(frozen=True)
class ProbeOutcome:
    """The answer at a port.

    Attributes:
        text: reading, status, or fault with remedy.
    """

    port: str
    answers: bool
    text: str


def ports() -> list[tuple[str, str]]:
    """Return name and description of every serial port."""
    return [(name, description) for name, description, _ in connected_ports()]


def probe(protocol: Protocol, port: str, baud: int | None = None, patience_s: float = PATIENCE_S) -> ProbeOutcome:
    """Ask a port for a reading of an instrument."""
    try:
        with Instrument(protocol, port, baud=baud, timeout_s=patience_s) as source:
            end_s = time.monotonic() + patience_s
            while time.monotonic() < end_s:
                readings = source.drain()
                if readings:
                    last = readings[-1]
                    if last.length_mm is not None:
                        return ProbeOutcome(port, answers=True, text=f"{last.length_mm:.4f} mm")
                    return ProbeOutcome(port, answers=True, text=f"no bar: {last.said or last.status}")
                time.sleep(_LOOK_S)
    except StationError as error:
        return ProbeOutcome(port, answers=False, text=f"{error.what}; {error.remedy}" if error.remedy else error.what)
    return ProbeOutcome(port, answers=False, text="nothing came")
