"""Write the session file again from its event log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.recordings.event_log import EVENTS_FILE, read_event_log
from dbbstation.files.recordings.lock import PATIENCE_S, SessionLock
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_store import SessionStore

if TYPE_CHECKING:
    from pathlib import Path


def rebuild(folder: Path) -> tuple[str, int]:
    """Write the session file from the log; the former one is kept.

    Raises:
        InputError: there is no log, or it does not fit the session's files.
        OutputError: another process writes into the session, or the disk refuses.
    """
    faults: list[Problem] = []
    log = read_event_log(folder, faults)
    if log is None or not log.events:
        what = f"there is no {EVENTS_FILE} from which the session file could be written"
        raise InputError(faults or [Problem(str(folder), 0, 0, what, "restore the session file from a backup")])
    with SessionLock(folder, PATIENCE_S):
        store = SessionStore(folder, anew=True)
        read_session(folder)
    return store.put_aside or "", len(store.log.events)
