"""Let a serial driver mark damaged characters, on systems with termios."""

from __future__ import annotations

from contextlib import suppress

LINE_ERRORS: tuple[type[Exception], ...] = ()
"""Errors that a port can raise in addition to OSError."""

try:
    import termios
except ImportError:  # Windows
    HAS_TERMIOS = False
else:
    HAS_TERMIOS = True
    LINE_ERRORS = (termios.error,)


def mark_damaged(descriptor: int) -> bool:
    """Let the driver mark characters with a wrong parity or stop bit; return whether it does.

    INPCK and PARMRK, IEEE Std 1003.1-2017, 11.2.2 Input Modes. Windows marks nothing.
    """
    if not HAS_TERMIOS:
        return False
    wanted = termios.INPCK | termios.PARMRK
    with suppress(termios.error):
        settings = termios.tcgetattr(descriptor)
        settings[0] &= ~(termios.IGNPAR | termios.ISTRIP | termios.IGNBRK | termios.BRKINT)
        settings[0] |= wanted
        termios.tcsetattr(descriptor, termios.TCSANOW, settings)
        # The system may take some of the settings and say nothing of the others.
        return termios.tcgetattr(descriptor)[0] & wanted == wanted
    return False
