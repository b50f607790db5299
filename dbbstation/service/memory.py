"""Last choices and open sessions, kept in the user's state folder."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
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

_NO_LINE = Line()


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid")

    machine: str = ""
    plan: str = ""
    line: Line = Line()
    operator: str = ""
    serial_number: str = ""
    sessions: dict[str, Line] = {}


@dataclass(frozen=True)
class Remembered:
    """Last choices."""

    machine: Path | None = None
    plan: Path | None = None
    line: Line = _NO_LINE
    operator: str = ""
    serial_number: str = ""
    sessions: tuple[tuple[Path, Line], ...] = ()

    def line_of(self, folder: Path) -> Line:
        """Return a session's remembered instrument, else the last chosen one."""
        return dict(self.sessions).get(folder.absolute(), self.line)

    def with_session(self, folder: Path, line: Line) -> Remembered:
        """Return the memory with a newly opened session. A virtual line is remembered for its session only."""
        folder = folder.absolute()
        others = [(other, by) for other, by in self.sessions if other != folder]
        last = self.line if line.virtual else line
        return replace(self, line=last, sessions=((folder, line), *others)[:MOST])


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
            file = _File.model_validate_json(content_of(self.path, LARGEST_BYTES))
        except (OSError, ValidationError):
            return Remembered()
        sessions = tuple((Path(folder), line) for folder, line in file.sessions.items())
        machine, plan = (Path(name) if name else None for name in (file.machine, file.plan))
        last = _NO_LINE if file.line.virtual else file.line  # older programs remembered a virtual one like any other
        return Remembered(machine, plan, last, file.operator, file.serial_number, sessions)

    def write(self, remembered: Remembered) -> None:
        """Keep the last choices if possible."""
        file = _File(
            machine=str(remembered.machine or ""),
            plan=str(remembered.plan or ""),
            line=remembered.line,
            operator=remembered.operator,
            serial_number=remembered.serial_number,
            sessions={str(folder): line for folder, line in remembered.sessions},
        )
        with suppress(OSError, OutputError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_text(self.path, file.model_dump_json(indent=1) + "\n", force=True, rewrites=True)
