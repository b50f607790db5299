"""A terminal as a person sees it: what standard error gets goes through a pseudo-terminal and an emulator of its screen."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import struct
import termios
import threading
from contextlib import redirect_stderr
from dataclasses import dataclass, field

import pyte

COLUMNS, ROWS = 80, 40

END = b"\0"
"""Sent when the work is over."""

TERMINALS = {
    "colours": {"TERM": "xterm-256color"},
    "no-color": {"TERM": "xterm-256color", "NO_COLOR": "1"},
    "dumb": {"TERM": "dumb"},
}
"""Environments of a terminal."""

BAR = re.compile(r"^ *(.+?) ([━╸╺ ]{24}) +(?:(\d+) of (\d+)°?|(\d+)%)(?: (\d+) s left,)? ?(.*)$")
"""A whole bar: label, line, how far, seconds that are left, text."""


@dataclass
class Seen:
    """What a screen showed.

    Attributes:
        screens: its lines whenever they changed, without blanks at their ends and empty lines below.
    """

    raw: bytes = b""
    screens: list[list[str]] = field(default_factory=list)
    coloured: bool = False

    @property
    def last(self) -> list[str]:
        return self.screens[-1] if self.screens else []


def watched(work, monkeypatch, terminal="colours") -> Seen:
    """Do some work with standard error on a terminal of 80 columns, and watch its screen."""
    for name in ("TERM", "NO_COLOR", "FORCE_COLOR", "COLORTERM"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"COLUMNS": str(COLUMNS), **TERMINALS[terminal]}.items():
        monkeypatch.setenv(name, value)
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, COLUMNS, 0, 0))
    seen = Seen()
    watching = threading.Thread(target=_watch, args=(ours, seen))
    watching.start()
    try:
        with os.fdopen(theirs, "w", buffering=1) as screen:
            try:
                with redirect_stderr(screen):
                    work()
            finally:
                screen.write(END.decode())  # a process that the work started may hold the terminal open
                screen.flush()
                watching.join()
    finally:
        os.close(ours)
    return seen


def _watch(end: int, seen: Seen) -> None:
    """Read until the work is over; a screen is looked at between whole pieces that were written."""
    screen = pyte.Screen(COLUMNS, ROWS)
    stream = pyte.ByteStream(screen)
    while END not in seen.raw:
        came = os.read(end, 65536)
        seen.raw += came
        # What is drawn and taken away at once is looked at before it is erased.
        for drawn in re.split(rb"(?=\r\x1b\[2K)", came):
            for piece in drawn.splitlines(keepends=True):
                stream.feed(piece)
            shown = [line.rstrip() for line in screen.display]
            while shown and not shown[-1]:
                shown.pop()
            seen.coloured |= any(cell.fg != "default" for row in screen.buffer.values() for cell in row.values())
            if shown != seen.last:
                seen.screens.append(shown)
    seen.raw = seen.raw.removesuffix(END)


def bars(lines) -> list[re.Match[str]]:
    return [found for line in lines if (found := BAR.match(line))]


def share(bar: re.Match[str]) -> float:
    return int(bar[5]) / 100.0 if bar[5] else int(bar[3]) / int(bar[4])
