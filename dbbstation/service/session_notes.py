"""Notes, temperatures and verdicts for a session without a running sequence."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pydantic import TypeAdapter, ValidationError

from dbbstation.errors import OutputError
from dbbstation.facts.quantities import TemperatureDegc
from dbbstation.files.formats.session import Note, starts_of
from dbbstation.files.recordings.lock import PATIENCE_S
from dbbstation.files.recordings.session_writer import SessionWriter

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.station.commands import Judge

_NOTED: TypeAdapter[float] = TypeAdapter(TemperatureDegc)


def shop_degc(text: str) -> float | None:
    """Return a text's temperature [degC], decimal comma allowed; None if not allowed in a session."""
    try:
        return _NOTED.validate_python(float(text.replace(",", ".")))
    except (ValueError, ValidationError):
        return None


def add_note(folder: Path, text: str = "", degc: float | None = None) -> None:
    """Note a text or the shop's temperature [degC] in a session without a running sequence; a running one needs `AddNote`.

    Raises:
        InputError: the session has faults.
        OutputError: another process writes into it, or the disk refuses.
    """
    with SessionWriter.open(folder, PATIENCE_S) as writer:
        # On a virtual machine that runs faster than real time, runs and notes bear times ahead of the present.
        runs = starts_of(writer.runs)
        notes = [note.made for note in writer.session.notes]
        writer.note(Note(max([datetime.now(UTC), *runs, *notes]), text, degc))


RELEASE_S = 5.0
"""Time within which an ended sequence releases the session [s]."""


def give_verdict(folder: Path, command: Judge) -> None:
    """Note another verdict in the session.

    Raises:
        InputError: faults of the session.
        OutputError: no such run, another process writes into the session, or the disk refuses.
    """
    with SessionWriter.open(folder, RELEASE_S) as writer:
        run = next((one for one in writer.runs if one.key == command.key), None)
        if run is None:
            raise OutputError(
                f"the session has no run {command.label}", where=str(folder), remedy="choose one that it has"
            )
        writer.judge(run, accepted=command.accepted, reason=command.reason)
