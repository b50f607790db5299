"""Change verdicts on runs after the sequence has ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import OutputError
from dbbstation.files.recordings.session_writer import SessionWriter

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.station.commands import Judge

PATIENCE_S = 5.0
"""Time within which an ended sequence releases the session [s]."""


def give_verdict(folder: Path, command: Judge) -> None:
    """Note another verdict in the session.

    Raises:
        InputError: faults of the session.
        OutputError: no such run, another process writes into the session, or the disk refuses.
    """
    with SessionWriter.open(folder, PATIENCE_S) as writer:
        key = (command.test, command.direction, command.repeat)
        run = next((one for one in writer.runs if (one.test, one.direction, one.repeat) == key), None)
        if run is None:
            name = f"{command.test}-{command.direction}-{command.repeat}"
            raise OutputError(f"the session has no run {name}", where=str(folder), remedy="choose one that it has")
        writer.judge(run, accepted=command.accepted, reason=command.reason)
