"""Last choices and open sessions, kept in the user's state folder."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict, ValidationError

from dbbstation.errors import OutputError
from dbbstation.files.atomic import write_text
from dbbstation.files.gateway import content_of
from dbbstation.instrument.library import load_instrument, with_zero
from dbbstation.system.ports import time_scale_of, virtual_port

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.instrument.protocol import Protocol

FILE = "station.json"
"""Name of the memory's file in the user's state folder."""

LARGEST_BYTES = 1_000_000
"""Largest file that is read: twenty sessions and their lines need some kilobytes."""

MOST = 20
"""Number of remembered sessions."""


class Line(BaseModel):
    """An instrument and its port."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    instrument: str = ""
    """Name or protocol file."""
    profile: str = ""
    """Variant of the instrument; empty: the usual one."""
    port: str = ""
    """Name or URL of the port, or the name for a virtual machine in this program."""
    baud: int | None = None
    """Baud rate if it is not the usual one."""
    zero_mm: float | None = None
    """Length at which a relative instrument shows zero [mm]."""

    @property
    def virtual(self) -> bool:
        """Return whether machine and instrument are virtual."""
        return time_scale_of(self.port) is not None

    @property
    def time_scale(self) -> float:
        """Return the virtual machine's speed relative to real time."""
        return time_scale_of(self.port) or 1.0

    def protocol(self, at_zero_mm: Callable[[], float | None]) -> Protocol:
        """Return the instrument's protocol.

        Args:
            at_zero_mm: length at the zero of a relative instrument, if the line states none.

        Raises:
            StationError: no such instrument, or the length at its zero is not stated.
        """
        found = load_instrument(self.instrument, self.profile or None)
        if not found.length.relative:
            return found
        return with_zero(found, at_zero_mm() if self.zero_mm is None else self.zero_mm)


VIRTUAL = (virtual_port(), virtual_port(10.0))
"""Choice in the list of ports that needs no hardware."""


class Remembered(BaseModel):
    """Last choices."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    machine: Path | None = None
    plan: Path | None = None
    line: Line = Line()
    operator: str = ""
    serial_number: str = ""
    sessions: dict[Path, Line] = {}

    def line_of(self, folder: Path) -> Line:
        """Return a session's remembered instrument, else the last chosen one."""
        return self.sessions.get(folder.absolute(), self.line)

    def with_session(self, folder: Path, line: Line) -> Remembered:
        """Return the memory with a newly opened session. A virtual line is remembered for its session only."""
        folder = folder.absolute()
        sessions = [(folder, line), *(one for one in self.sessions.items() if one[0] != folder)][:MOST]
        return self.model_copy(update={"line": self.line if line.virtual else line, "sessions": dict(sessions)})


class Memory:
    """The file of last choices."""

    def __init__(self, path: Path | None = None) -> None:
        self._path = path

    @property
    def path(self) -> Path:
        """Return its path."""
        if self._path is None:
            import platformdirs  # noqa: PLC0415 - only who remembers looks for the user's folders

            self._path = platformdirs.user_state_path("dbbstation", appauthor=False) / FILE
        return self._path

    def read(self) -> Remembered:
        """Return the last choices; empty if the file is missing or unreadable."""
        try:
            found = Remembered.model_validate_json(content_of(self.path, LARGEST_BYTES))
        except (OSError, ValidationError):
            return Remembered()
        # Older programs remembered a virtual line like any other.
        return found.model_copy(update={"line": Line()}) if found.line.virtual else found

    def write(self, remembered: Remembered) -> None:
        """Keep the last choices if possible."""
        with suppress(OSError, OutputError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self.path, remembered.model_dump_json(indent=1) + "\n", force=True, rewrites=True)
