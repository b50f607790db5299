"""A pseudo-terminal, which a program opens like a serial port; Windows has none."""

from __future__ import annotations

import errno
import os
import select

try:
    import termios
    import tty
except ImportError:  # Windows
    HAS_PTY = False
else:
    _RATES = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}
    HAS_PTY = hasattr(os, "openpty")


class PtyEnd:
    """A pseudo-terminal; this side is the master, the program opens the slave by name."""

    def __init__(self) -> None:
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        # Closed here, so that `wait` sees whether a program has it open.
        os.close(slave)
        os.set_blocking(self._master, False)
        self.connected = False

    def wait(self, real_s: float) -> bool:
        """Wait at most this long for bytes; return whether there are any."""
        poller = select.poll()
        poller.register(self._master, select.POLLIN)
        # Without a program at the other end poll returns at once, so it is asked first and slept apart.
        now = dict(poller.poll(0)).get(self._master, 0)
        self.connected = not now & select.POLLHUP
        if now & select.POLLIN:
            return True
        if not self.connected:
            select.select([], [], [], real_s)
            return False
        return bool(select.select([self._master], [], [], real_s)[0])

    def read(self) -> bytes:
        """Return the bytes that have arrived."""
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            self.connected = False
            return b""

    def write(self, raw: bytes) -> int:
        """Send as much as the line takes at once; return the number of bytes."""
        try:
            return os.write(self._master, raw)
        except BlockingIOError:
            return 0

    def host_baud(self) -> int | None:
        """Return the rate set by the other side."""
        return _RATES.get(termios.tcgetattr(self._master)[5])

    def close(self) -> None:
        """Close the line."""
        if self._master >= 0:
            os.close(self._master)
        self._master = -1
