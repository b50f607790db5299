"""Read and write a session file and its event log together, under the session's lock."""

from __future__ import annotations

import logging
import os
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from dbbstation.errors import InputError, OutputError, Problem, refuse
from dbbstation.files.atomic import write_folder, write_text
from dbbstation.files.formats.session import SessionFile
from dbbstation.files.gateway import sha256_hex
from dbbstation.files.places import SESSION_FILE
from dbbstation.files.recordings.event_log import (
    EVENTS_FILE,
    EventLog,
    appended,
    change,
    line_of,
    read_event_log,
    taken_back,
)
from dbbstation.files.recordings.seal import AMEND, copy_name, hash_in
from dbbstation.files.recordings.session_state import (
    READINGS,
    SEALED,
    Stands,
    differences,
    mark_of,
    session_state,
    standing,
    text_of,
    with_readings,
)
from dbbstation.files.source_text import decode, read_bytes
from dbbstation.files.yaml.schema import read_document, validate
from dbbstation.files.yaml.text import parse_yaml

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from dbbstation.files.yaml.text import YamlDocument

_LOG = logging.getLogger(__name__)

REBUILD = "`dbbstation session rebuild {folder}` writes it as the event log has it"
"""Advice for a changed session file."""


def now() -> datetime:
    """Return the time with its zone, to the second."""
    return datetime.now(UTC).replace(microsecond=0)


def marked(state: Mapping[str, Any], log: EventLog) -> dict[str, object]:
    """Return a state with the log's position."""
    if not log.events or not isinstance(state.get("seal"), dict):
        return dict(state)
    return {"runs": [], **_with_mark(state, state, len(log.events), log.links[-1])}


def first_log(data: Mapping[str, Any], at: datetime | None) -> tuple[bytes, dict[str, object]]:
    """Return the log of a new session and its session file's content."""
    state: Mapping[str, Any] = session_state(data)
    line = line_of("", "created", at, change({}, state))
    return line, _with_mark(data, state, 1, line[:64].decode())


def _with_mark(data: Mapping[str, Any], state: Mapping[str, Any], events: int, sha256: str) -> dict[str, object]:
    return {**data, "seal": {**state["seal"], "log": {"events": events, "sha256": sha256}}}


def document_in_force(file: Path, faults: list[Problem]) -> tuple[YamlDocument | None, EventLog | None]:
    """Read a session file and its log; if unreadable, return no document and add faults to `faults`."""
    found: list[Problem] = []
    document = read_document(file, SessionFile, found)
    log = read_event_log(file.parent, found)
    if document is None and log is not None and log.events:
        found = [replace(each, remedy=_rebuild(file)) for each in found]
    faults += found
    if log is None and found:
        return None, None
    if document is None:
        return None, log
    document = replace(document, faults=faults)
    if found or validate(replace(document, faults=[]), SessionFile) is None:
        return document, log
    if log is not None and standing(document.data, log).stands is Stands.BEHIND:
        text = text_of(marked(with_readings(log.state(), document.data), log))
        return parse_yaml(text, str(file), faults), log
    return document, log


def log_faults(file: Path, data: Mapping[str, Any], log: EventLog | None, *, but_runs: bool) -> list[Problem]:
    """Return differences of a session file and its event log.

    Args:
        but_runs: as for `standing`.
    """
    stands = standing(data, log, but_runs=but_runs)
    remedy = AMEND.format(folder=file.parent)
    if not stands.log_sound:
        return [Problem.of(file.parent / EVENTS_FILE, what, remedy) for what in stands.differences]
    remedy = remedy.replace("restore it", _rebuild(file))
    return [Problem.of(file, f"{what}, by the event log", remedy) for what in stands.differences]


def _rebuild(file: Path) -> str:
    return REBUILD.format(folder=file.parent)


class SessionStore:
    """Reads and writes a session file with its log, under the session's lock.

    A damaged, missing or outdated session file is written again from the log; the former file is kept.

    Args:
        anew: write the session file from the log in any case.

    Attributes:
        log: empty if the session has none yet.
        sha256: of the session file at the last reading or writing.
        put_aside: place of a replaced session file; empty if it was missing, None if none was replaced.

    Raises:
        InputError: there is no session, or neither file nor log is readable.
        OutputError: the disk refuses.
    """

    def __init__(self, folder: Path, clock: Callable[[], datetime] = now, *, anew: bool = False) -> None:
        self._file = folder / SESSION_FILE
        self._clock = clock
        self.put_aside: str | None = None
        faults: list[Problem] = []
        self.log = read_event_log(folder, faults) or EventLog(folder / EVENTS_FILE)
        refuse(faults)
        found, data = self._on_disk(faults)
        self.data: dict[str, object] = data or {}
        if (data is None or anew) and self.log.events:
            self._rebuild(found)
            return
        if data is None or found is None:
            raise InputError(faults)
        self.sha256 = sha256_hex(found)
        self.state = session_state(data)
        if _valid(data) and standing(data, self.log).stands is Stands.BEHIND:
            self.state = with_readings(self.log.state(), data)
            self.data = marked(self.state, self.log)
            self._put(text_of(self.data))

    def write(self, data: Mapping[str, Any], what: str, text: Callable[[Mapping[str, Any]], str] = text_of) -> None:
        """Log the changes, then write the session file.

        Raises:
            OutputError: the file has changed since it was read, or the disk refuses; both are restored.
        """
        state, before = session_state(data), self.log
        first = not before.events and "seal" in state
        members = change({} if first else self.state, state)
        if not (first or members):
            return
        if self.changed_meanwhile() is not None:
            raise self._another("")
        if "seal" in state:
            self.log = appended(before, SEALED if first else what, self._clock(), members)
        said = text({**data, **({"seal": marked(state, self.log)["seal"]} if "seal" in state else {})})
        try:
            self._put(said)
        except BaseException as error:
            # In its place, and in the log on the disk: what failed is only to make the new name last, which the log does as well.
            if self.log is before or not isinstance(error, OutputError) or self._on_disk([])[0] != said.encode():
                if self.log is not before:
                    taken_back(before)
                    self.log = replace(before, size=before.end)
                raise
            _LOG.warning("%s", error)
            self.sha256 = sha256_hex(said)
        self.state = state

    def begin_anew(self) -> None:
        """Remove an unreliable log, which the caller has already copied."""
        (self._file.parent / EVENTS_FILE).unlink(missing_ok=True)
        self.log = EventLog(self._file.parent / EVENTS_FILE)

    def changed_meanwhile(self) -> dict[str, object] | None:
        """Return the content of a session file that was changed in the meantime, or None.

        Raises:
            InputError: it exists and cannot be read.
            OutputError: the disk refuses.
        """
        found = read_bytes(self._file, [], is_input=False)
        if found is not None and sha256_hex(found) == self.sha256:
            return None
        found, data = self._on_disk([])
        if data is None:
            self.put_aside = self._kept(found)
            self.sha256 = "" if found is None else sha256_hex(found)
        return data

    def accept_readings(self, data: Mapping[str, Any]) -> None:
        """Accept a session file to which only readings were added.

        Raises:
            OutputError: something else was changed too.
        """
        # Whoever opened the file in an editor some runs ago saves what it said then.
        known, mark = self.state, mark_of(data)
        if mark is not None and mark[0] <= len(self.log.events):
            known = self.log.state(mark[0])
        found = differences(_bare(known), _bare(session_state(data)))
        if found:
            raise self._another(f": {'; '.join(found)}")
        self.sha256 = hash_in(self._file.parent, SESSION_FILE)

    def _another(self, what: str) -> OutputError:
        return OutputError(
            f"somebody has changed the session file since it was read{what}",
            where=str(self._file),
            remedy=f"nothing was written over it; {_rebuild(self._file)}",
        )

    def _on_disk(self, faults: list[Problem]) -> tuple[bytes | None, dict[str, object] | None]:
        """Return bytes and data of the session file. If it is damaged or missing, return no data and add the reason to `faults`."""
        found = read_bytes(self._file, faults, is_input=False)
        text = None if found is None else decode(found, str(self._file), faults)
        document = None if text is None else parse_yaml(text, str(self._file), faults)
        if found is None and os.path.lexists(self._file):
            raise InputError(faults)  # it may hold what somebody has written: it is not taken for gone
        if document is None:
            return found, None
        if not isinstance(document.data, dict) or "format" not in document.data:
            document.fault((), "this is no session file", "restore it")
            return found, None
        return found, document.data

    def _rebuild(self, found: bytes | None) -> None:
        self.state = self.log.state()
        self.data = marked(self.state, self.log)
        self.put_aside = self._kept(found)
        self._put(text_of(self.data))

    def _kept(self, found: bytes | None) -> str:
        if not found:
            return ""
        name = copy_name(SESSION_FILE, sha256_hex(found))
        if not (self._file.parent / name).exists():
            write_folder(self._file.parent, {name: found}, own=True)
        _LOG.warning("%s is written anew; as it was: %s", self._file, name)
        return name

    def _put(self, text: str) -> None:
        write_text(self._file, text, force=True, rewrites=True)
        self.sha256 = sha256_hex(text)


def _valid(data: Mapping[str, Any]) -> bool:
    document = parse_yaml(text_of(data), SESSION_FILE, [])
    return document is not None and validate(document, SessionFile) is not None


def _bare(state: Mapping[str, Any]) -> dict[str, object]:
    return {key: value for key, value in state.items() if key != READINGS}
