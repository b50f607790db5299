"""The serial link: open a port, read and write, and explain faults."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import serial
from serial.tools import list_ports
from serial.urlhandler.protocol_socket import Serial as SocketPort

from dbbstation.errors import InstrumentError
from dbbstation.instrument.damaged import Marks
from dbbstation.system.ports import LINE_ERRORS, holders, mark_damaged

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo

    from dbbstation.instrument.bytelog import ByteLog
    from dbbstation.instrument.protocol import LineSettings

_ERRORS: tuple[type[Exception], ...] = (serial.SerialException, OSError, TypeError, *LINE_ERRORS)
"""Errors that a port can raise: pyserial passes on some system errors, and a TypeError of a port that was just
closed."""

_OPENING_ERRORS: tuple[type[Exception], ...] = (*_ERRORS, ValueError)

_TICK_S = 0.02
"""Longest wait of a read [s], so that the reader thread stops soon after a request."""

_MOST = 1 << 16
"""Greatest number of bytes that are read from a socket at once."""

_PARITY = {"none": serial.PARITY_NONE, "even": serial.PARITY_EVEN, "odd": serial.PARITY_ODD}

_BUSY = {errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK}


class Port(Protocol):
    """The methods of pyserial that the driver uses; a test port may replace it."""

    @property
    def in_waiting(self) -> int:
        """Return the number of bytes that can be read at once."""

    def read(self, size: int = 1, /) -> bytes:
        """Return up to `size` bytes, fewer after the port's timeout."""

    def write(self, data: bytes, /) -> int | None:
        """Send the bytes."""


class LineClosedError(InstrumentError):
    """The system closed the line, as after unplugging."""


@dataclass(frozen=True, eq=False)
class Link:
    """An open line to an instrument."""

    port: Port
    _: KW_ONLY
    name: str
    owned: bool
    log: ByteLog | None = None
    marks: Marks | None = None
    has_bits: bool = True

    @property
    def sees_damage(self) -> bool:
        """Return whether wrong parity or stop bits are detected."""
        return self.marks is not None

    @property
    def eighth_bit_marks(self) -> bool:
        """Return whether the eighth bit of a seven-bit character can only mark wrong parity."""
        return self.marks is not None and self.has_bits

    def read(self) -> bytes:
        """Return the bytes that arrive within a short wait; may be empty.

        Raises:
            LineClosedError: the line is closed.
        """
        try:
            raw = self.port.read(1)
            if raw:
                raw += self._rest()
        except _ERRORS as error:
            raise self._gone(error) from None
        if self.marks is not None:
            raw = self.marks.taken_out(raw)
        if raw and self.log is not None:
            self.log.note("<", raw)
        return raw

    def _rest(self) -> bytes:
        with suppress(*_ERRORS):
            # What is wrong with the line comes up again with the next read; what was read is not thrown away for it.
            if isinstance(self.port, SocketPort):
                # A socket does not tell how much has come; without patience it gives all of it.
                self.port.timeout = 0
                rest = self.port.read(_MOST)
                self.port.timeout = _TICK_S
                return rest
            waiting = self.port.in_waiting
            return self.port.read(waiting) if waiting else b""
        return b""

    def write(self, raw: bytes) -> None:
        """Send bytes.

        Raises:
            LineClosedError: the line is closed.
        """
        if self.log is not None:
            self.log.note(">", raw)
        try:
            self.port.write(raw)
        except _ERRORS as error:
            raise self._gone(error) from None

    def close(self) -> None:
        """Close the port if this link opened it."""
        if self.owned:
            _close_quietly(self.port)

    def _gone(self, error: Exception) -> LineClosedError:
        return LineClosedError(
            "the line was closed while it was in use",
            where=self.name,
            remedy=f"plug the instrument in again and check its cable and power; the system says: {_first_words(error)}",
        )


def _close_quietly(port: object) -> None:
    # pyserial forgets to close a socket whose other side hung up: its shutdown fails first.
    for opened in (port, getattr(port, "_socket", None)):
        close = getattr(opened, "close", None)
        if close is not None:
            with suppress(*_ERRORS):
                close()


def name_of(port: str | Port) -> str:
    """Return the name of a port for messages."""
    return port if isinstance(port, str) else str(getattr(port, "name", None) or "open port")


def open_link(
    port: str | Port, line: LineSettings, *, baud: int | None = None, log: ByteLog | None = None, text: bool = False
) -> Link:
    """Open a line to an instrument.

    Args:
        port: name (`/dev/ttyUSB0`, `COM3`), pyserial URL (`socket://127.0.0.1:4001`), or open port.
        text: all input is text, so that damaged characters can be marked.

    Raises:
        InstrumentError: no such port, no permission, in use, or unsupported settings.
    """
    if not isinstance(port, str):
        return Link(port, name=name_of(port), owned=False, log=log)
    speed = baud or line.baud
    # A pseudo-terminal has no bits: asked a second time for parity, the system finds nothing to change and refuses.
    has_bits = not ("://" not in port and os.path.realpath(port).startswith(("/dev/pts/", "/dev/ttys")))
    bits = (line.data_bits, line.parity, line.stop_bits) if has_bits else (8, "none", 1)
    opened = None
    try:
        opened = serial.serial_for_url(
            port,
            do_not_open=True,
            baudrate=speed,
            bytesize=bits[0],
            parity=_PARITY[bits[1]],
            stopbits=bits[2],
            rtscts=line.flow == "rts-cts",
            xonxoff=line.flow == "xon-xoff",
            timeout=_TICK_S,
        )
        if "://" not in port:
            opened.exclusive = True
        opened.open()
    except _OPENING_ERRORS as error:
        _close_quietly(opened)
        what, remedy = _why_not_opened(port, speed, error)
        raise InstrumentError(what, where=port, remedy=remedy) from None
    descriptor = getattr(opened, "fd", None)  # of a serial port; a socket marks nothing
    marked = text and isinstance(descriptor, int) and mark_damaged(descriptor)
    marks = Marks(line.data_bits) if marked else None
    return Link(opened, name=port, owned=True, log=log, marks=marks, has_bits=has_bits)


def connected_ports() -> list[tuple[str, str, str]]:
    """Return name, description and hardware id of every serial port, sorted by name."""
    return sorted((port.device, port.description or "", port.hwid or "") for port in list_ports.comports())


def _why_not_opened(port: str, baud: int, error: Exception) -> tuple[str, str]:
    number = getattr(error, "errno", None)
    words = str(error).lower()
    if "://" in port:
        remedy = "is the instrument's server running, and are host and port number right?"
        return f"cannot connect: {_first_words(error)}", remedy
    if number == errno.ENOENT or "filenotfound" in words:
        names = ", ".join(name for name, _, _ in connected_ports())
        remedy = f"connected are {names}" if names else "no serial port is connected: plug the adapter in"
        return "there is no such port", f"{remedy}; see `dbbstation instrument ports`"
    if number in _BUSY or "access is denied" in words:
        who = ", ".join(holders(port))
        remedy = "close the other program, for example a second monitor or a terminal program"
        return f"another program has the port open{f': {who}' if who else ''}", remedy
    if number in {errno.EACCES, errno.EPERM}:
        remedy = f"add yourself to the group that owns it ({_group(port)}) and log in again"
        return "no permission to open the port", remedy
    if "baud" in words or (isinstance(error, ValueError) and baud not in serial.Serial.BAUDRATES):
        remedy = "set the instrument to a usual rate such as 9600, 19200 or 115200 and give it with --baud"
        return f"the port does not take the baud rate {baud}", remedy
    what = f"this is no serial port that can be used: {_first_words(error)}"
    return what, "see `dbbstation instrument ports`"


def _group(port: str) -> str:
    try:
        return Path(port).group()
    except (OSError, KeyError, NotImplementedError):
        return "dialout"


def _first_words(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


def adapter_of(port: str) -> ListPortInfo | None:
    """Return the adapter of a port, or None if the port is not USB or has gone."""
    return next((one for one in _adapters() if one.device == port), None)


def port_of(adapter: ListPortInfo) -> str | None:
    """Return the adapter's current port, or None.

    For an adapter without serial number, the socket alone decides.
    """
    return next((one.device for one in _adapters() if _identity(one) == _identity(adapter)), None)


def _adapters() -> list[ListPortInfo]:
    return [port for port in list_ports.comports() if None not in (port.vid, port.pid)]


def _identity(port: ListPortInfo) -> tuple[object, ...]:
    return port.vid, port.pid, port.serial_number or port.location or "", bool(port.serial_number)
