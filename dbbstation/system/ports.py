"""Serial ports: programs that have one open, marks of damaged characters, and ports of virtual instruments."""

from __future__ import annotations

import os
import re
import tempfile
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

if TYPE_CHECKING:
    from collections.abc import Iterator

_PROC = Path("/proc")


def holders(port: str, proc: Path = _PROC) -> list[str]:
    """Return name and number of every other process with this port open, such as `minicom (process 4711)`.

    Linux lists processes of the same user, and all processes for root. On other systems the list is empty.
    """
    target = os.path.realpath(port)
    others = [one for one in _entries(proc) if one.name.isdecimal() and int(one.name) != os.getpid()]
    holding = [one for one in others if any(_leads_to(link, target) for link in _entries(one / "fd"))]
    return [f"{_name(one)} (process {one.name})" for one in sorted(holding, key=lambda one: int(one.name))]


def _entries(folder: Path) -> list[Path]:
    with suppress(OSError):  # it has ended, or belongs to somebody else
        return list(folder.iterdir())
    return []


def _leads_to(link: Path, target: str) -> bool:
    with suppress(OSError):
        return str(link.readlink()) == target
    return False


def _name(process: Path) -> str:
    try:
        return (process / "comm").read_text(encoding="utf-8", errors="replace").strip() or "a program"
    except OSError:
        return "a program"


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


@contextmanager
def marked_virtual(port: str) -> Iterator[None]:
    """Mark a port of this process as virtual."""
    mark = _mark(port)
    with suppress(OSError):  # a mark that cannot be written costs the word VIRTUAL, not the machine
        mark.parent.mkdir(exist_ok=True)
        mark.write_text(str(os.getpid()), encoding="ascii")
    try:
        yield
    finally:
        with suppress(OSError):
            mark.unlink()


def is_virtual(port: str) -> bool:
    """Return whether a running program of this computer has marked the port.

    Bridges and replays are not detected.
    """
    try:
        process = int(_mark(port).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return False
    import psutil  # noqa: PLC0415 - few commands ask

    return psutil.pid_exists(process)


def _mark(port: str) -> Path:
    name = port if "//" in port else os.path.realpath(port)
    return Path(tempfile.gettempdir()) / "dbbstation-virtual" / quote(name, safe="")


SLOWEST, FASTEST = 0.01, 50.0
"""Slowest and fastest speed of a virtual machine relative to real time: slower ones seem to stand still, and computers
are too slow for faster ones."""

_NAME = "virtual machine"
_NAMED = re.compile(rf"{_NAME}(?:, ([0-9]+(?:\.[0-9]+)?) times faster)?")


def virtual_port(time_scale: float = 1.0) -> str:
    """Return the port name of a virtual machine."""
    return _NAME if time_scale == 1.0 else f"{_NAME}, {time_scale:g} times faster"


def time_scale_of(port: str) -> float | None:
    """Return the virtual machine's speed relative to real time; None for a real port."""
    named = _NAMED.fullmatch(port)
    if named is None:
        return None
    scale = float(named[1] or 1.0)
    return scale if SLOWEST <= scale <= FASTEST else None


def misspelt(port: str) -> bool:
    """Return whether a name is a misspelt name of a virtual machine."""
    return port.strip().lower().startswith("virtual") and time_scale_of(port) is None
