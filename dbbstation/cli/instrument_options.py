"""Options of real instruments: name, port, baud rate."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dbbstation.files.places import refuse_recorded
from dbbstation.tasks.declare import Option

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.protocol import Protocol

INSTRUMENT = Option(
    "Name of an instrument (`dbbstation instrument list`), or a protocol file.", metavar="NAME", setting="instrument"
)
PROFILE = Option(
    "Variant of the instrument, such as its firmware or resolution (`dbbstation instrument list NAME`).",
    metavar="NAME",
    setting="profile",
    goes_with="instrument",
)
ZERO_MM = Option(
    "Distance between the ball centres at which the instrument or the file reads zero [mm].", least=20.0, most=2000.0
)
PORT = Option("Port name, or a URL such as socket://127.0.0.1:4001 or rfc2217://127.0.0.1:4001.", setting="port")
BAUD = Option("Baud rate, if the instrument is not set to the usual one.", least=1, setting="baud")
Baud = Annotated[int | None, BAUD]
PROGRAMS = Option("Folder of NC programs that are named TEST-DIRECTION.", kind="folder")
RateHz = Annotated[
    float | None,
    Option("Sampling rate [1/s], if it differs from the instrument's usual rate.", least=0.1, most=100_000.0),
]
Spy = Annotated[
    Path | None,
    Option(
        "Write every byte of the serial line with its time into this new file, for `instrument replay`.", kind="file"
    ),
]


@dataclass(frozen=True, kw_only=True)
class ProtocolOptions:
    """Options of an instrument; the name is required unless the shop's settings have it."""

    instrument: Annotated[str, replace(INSTRUMENT, required=True)] = ""
    profile: Annotated[str | None, PROFILE] = None
    zero_mm: Annotated[float | None, ZERO_MM] = None

    def protocol(self, *, bar_length_mm: float | None = None) -> Protocol:
        """Return the instrument's protocol.

        Args:
            bar_length_mm: length at a relative instrument's zero, if no other is given.

        Raises:
            InstrumentError: unknown instrument or profile, or a relative instrument without zero.
            InputError: faults of the protocol file.
        """
        from dbbstation.instrument.library import load_instrument, with_zero

        protocol = load_instrument(self.instrument, self.profile)
        by_bar = self.zero_mm is None and protocol.length.relative
        return with_zero(protocol, bar_length_mm if by_bar else self.zero_mm)


@dataclass(frozen=True, kw_only=True)
class LineOptions(ProtocolOptions):
    """Options of an instrument on a line; the port is required unless the shop's settings have it."""

    port: Annotated[str, replace(PORT, required=True)] = ""
    baud: Baud = None


@dataclass(frozen=True, kw_only=True)
class OpenLine(LineOptions):
    """The options of `LineOptions`, none required."""

    instrument: Annotated[str, INSTRUMENT] = ""
    port: Annotated[str, PORT] = ""


@contextmanager
def spying(path: Path | None, protocol: Protocol, port: str, *, force: bool = False) -> Iterator[ByteLog | None]:
    """Open a byte log if requested.

    Raises:
        OutputError: the file exists, lies in a session, or cannot be written.
    """
    from dbbstation.instrument.bytelog import ByteLog

    if path is None:
        yield None
        return
    refuse_recorded(path)
    with ByteLog(path, instrument=protocol.name, profile=protocol.profile, port=port, force=force) as log:
        yield log
