"""The event log of a session: a chained line for each verdict, reason, condition and amendment.

Each line is on the disk before the session file changes. docs/formats.md describes the lines.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from dbbstation.errors import OutputError, Problem, unwritable
from dbbstation.files.atomic import told_of, write_bytes
from dbbstation.files.gateway import content_of, sha256_hex
from dbbstation.files.places import RUNS
from dbbstation.files.source_text import read_bytes
from dbbstation.system.handles import open_to_change, read_at, write_at
from dbbstation.system.replacing import sync_folder

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.files.formats.session import Seal

EVENTS_FILE = "events.log"
"""Name of the log in the session folder."""
_LINE = re.compile(rb"([0-9a-f]{64})  (\{.*\})")


@dataclass(frozen=True)
class LoggedEvent:
    """One line of the log.

    Attributes:
        what: the event in one or two words, such as `rejected`.
        at: None for a computed session, such as a simulated one.
        set_to: new values of session keys; None for removed ones.
        runs: entries; each replaces the entry of equal test, direction and repeat, or is appended.
        all_runs: the whole list if it was rearranged, else None.
    """

    what: str
    at: datetime | None
    set_to: Mapping[str, Any]
    runs: tuple[Mapping[str, Any], ...]
    all_runs: tuple[Mapping[str, Any], ...] | None
    link: str


@dataclass(frozen=True)
class EventLog:
    """The content of a log.

    Attributes:
        events: up to the first damaged line.
        end: bytes of these lines.
    """

    path: Path
    events: tuple[LoggedEvent, ...] = ()
    end: int = 0
    size: int = 0

    @property
    def links(self) -> tuple[str, ...]:
        """Return the link of every event."""
        return tuple(event.link for event in self.events)

    def state(self, count: int | None = None) -> dict[str, object]:
        """Return the session's state after `count` events; None: after all."""
        state: dict[str, object] = {}
        runs: dict[tuple[str, str, int], Mapping[str, Any]] = {}
        for event in self.events[:count]:
            state |= event.set_to
            if event.all_runs is not None:
                runs = {run_key(run): run for run in event.all_runs}
            runs |= {run_key(run): run for run in event.runs}
        state = {key: value for key, value in state.items() if value is not None}
        return {**state, "runs": list(runs.values())} if runs else state


def run_key(run: Mapping[str, Any]) -> tuple[str, str, int]:
    """Return the identity of an entry in the list of runs."""
    return run["test"], run["direction"], run["repeat"]


def change(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, object]:
    """Return the JSON members of an event that changes one state to another; empty for equal states."""
    keys = [key for key in (*after, *(key for key in before if key not in after)) if key != "runs"]
    set_to = {key: after.get(key) for key in keys if before.get(key) != after.get(key)}
    old = {run_key(run): run for run in before.get("runs", ())}
    new = {run_key(run): run for run in after.get("runs", ())}
    put = [run for key, run in new.items() if old.get(key) != run]
    found: dict[str, object] = {"set": set_to} if set_to else {}
    if list(old | new) != list(new) or len(new) != len(after.get("runs", ())):
        return {**found, "all_runs": list(after.get("runs", ()))}
    return {**found, "runs": put} if put else found


def read_event_log(folder: Path, faults: list[Problem]) -> EventLog | None:
    """Return a session's event log; None without one, or with the reason in `faults`."""
    path = folder / EVENTS_FILE
    if not os.path.lexists(path):
        return None
    data = read_bytes(path, faults, is_input=False)
    return None if data is None else _parsed(path, data)


def _parsed(path: Path, data: bytes) -> EventLog:
    events: list[LoggedEvent] = []
    end, before = 0, ""
    for line in data.splitlines(keepends=True):
        event = _event(line, before)
        if event is None:
            break
        events.append(event)
        end, before = end + len(line), event.link
    return EventLog(path, tuple(events), end, len(data))


def _event(line: bytes, before: str) -> LoggedEvent | None:
    parts = _LINE.fullmatch(line.removesuffix(b"\n"))
    if parts is None or not line.endswith(b"\n") or link(before, parts[2]) != parts[1].decode():
        return None
    try:
        said = json.loads(parts[2])
        at = said.get("at")
        runs, all_runs = said.get("runs", ()), said.get("all_runs")
        for run in (*runs, *(all_runs or ())):
            run_key(run)
        return LoggedEvent(
            what=str(said["what"]),
            at=None if at is None else datetime.fromisoformat(at),
            set_to=dict(said.get("set", {})),
            runs=tuple(runs),
            all_runs=None if all_runs is None else tuple(all_runs),
            link=parts[1].decode(),
        )
    except (KeyError, TypeError, ValueError, RecursionError):
        return None


def link(before: str, text: bytes) -> str:
    """Return the link of a line: SHA-256 of the previous link and the JSON text, each followed by a line feed."""
    return sha256_hex(before.encode() + b"\n" + text + b"\n")


def line_of(before: str, what: str, at: datetime | None, members: Mapping[str, Any]) -> bytes:
    """Return a line of the log.

    Args:
        before: link of the previous line; empty for the first.
        what: the event in one or two words.
        at: its time; None in computed sessions.
    """
    moment = {} if at is None else {"at": at.astimezone(UTC).isoformat().replace("+00:00", "Z")}
    text = json.dumps({**moment, "what": what, **members}, ensure_ascii=False, allow_nan=False).encode()
    return f"{link(before, text)}  ".encode() + text + b"\n"


def appended(log: EventLog, what: str, at: datetime | None, members: Mapping[str, Any]) -> EventLog:
    """Append an event and write it to the disk; arguments as for `line_of`. An unfinished last line is removed.

    Raises:
        OutputError: the log has changed since it was read, or the disk refuses; it is restored.
    """
    line = line_of(log.links[-1] if log.events else "", what, at, members)
    event = _event(line, log.links[-1] if log.events else "")
    if event is None:
        raise ValueError(f"{members} is not a change of a session file")
    # A log that was read is not begun anew where it has gone.
    try:
        handle = open_to_change(log.path, create=not log.size, private=True)
    except FileNotFoundError as error:
        raise OutputError(
            "the event log has disappeared: the session was moved or deleted during the measurement",
            where=str(log.path),
            remedy=f"restore it; then move the runs of {log.path.parent / RUNS} into its folder {RUNS}, where they replace a .part of the same run",
        ) from error
    except OSError as error:
        raise unwritable(error, log.path) from error
    try:
        _refuse_another(log, handle)
        if os.fstat(handle).st_nlink > 1:
            handle = _parted(log, handle)
        try:
            if log.size > log.end:
                os.ftruncate(handle, log.end)
            write_at(handle, line, log.end)
            os.fsync(handle)
            if not log.size:
                sync_folder(log.path.parent)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(handle, log.end)
            raise unwritable(error, log.path) from error
    finally:
        with contextlib.suppress(OSError):  # it is on the disk, or the reason is told already
            os.close(handle)
    end = log.end + len(line)
    return replace(log, events=(*log.events, event), end=end, size=end)


def _parted(log: EventLog, handle: int) -> int:
    """Replace the log by a copy if its file has hard links, so that a linked backup stays unchanged."""
    os.close(handle)  # Windows replaces no file that is open
    with told_of(log.path):
        write_bytes(log.path, content_of(log.path), force=True, rewrites=True)
        return open_to_change(log.path)


def set_back(log: EventLog) -> list[str]:
    """Return a sentence for each event that is dated before its predecessor."""
    dated = [(number, event, event.at) for number, event in enumerate(log.events, start=1) if event.at is not None]
    told = []
    for (_, _, before), (number, event, at) in pairwise(dated):
        back_s = (before - at).total_seconds()
        if back_s > CLOCK_S:
            told.append(
                f"the clock was set back by {back_s:.0f} s before event {number} ({event.what}): how much later than earlier runs "
                "those from then on were is not known"
            )
    return told


CLOCK_S = 1.0
"""Largest backward step of a clock that is ignored [s]: events are dated to the second, and network time corrects
clocks by less."""


def taken_back(log: EventLog) -> None:
    """Remove an appended event, if the disk allows."""
    with contextlib.suppress(OSError):
        handle = open_to_change(log.path)
        try:
            os.ftruncate(handle, log.end)
            os.fsync(handle)
        finally:
            os.close(handle)


def _refuse_another(log: EventLog, handle: int) -> None:
    size = os.fstat(handle).st_size
    last = log.links[-1] if log.events else ""
    begin = max(log.end - _LONGEST_LAST, 0)
    there = read_at(handle, log.end - begin, begin).splitlines()
    if size != log.size or (last and (not there or not _ends_with(there[-1], last))):
        raise OutputError(
            "another program has written into this session since it was read",
            where=str(log.path),
            remedy="end that program, then repeat the command",
        )


_LONGEST_LAST = 1_000_000
"""Greatest number of bytes that are read of the last line; an event with a thousand runs has half as many."""


def _ends_with(line: bytes, last: str) -> bool:
    return line.startswith(last.encode()) or len(line) >= _LONGEST_LAST


def runs_told(event: LoggedEvent) -> str:
    """Return text about an event's runs, with reasons of verdicts."""
    told = []
    for run in event.runs:
        name = f"{run['test']}-{run['direction']}-{run['repeat']}"
        told.append(f"{name}: {run['reason']}" if run.get("reason") else name)
    if event.all_runs is not None:
        told.append(f"list of {len(event.all_runs)} runs")
    return ", ".join(told)


def keys_told(event: LoggedEvent) -> Sequence[str]:
    """Return an event's keys, except runs and keys that change with every run."""
    return [key for key in event.set_to if key != "seal" or event.what not in _OF_RUNS]


_OF_RUNS = frozenset({"run started", "run sealed", "taken in"})


SHORTEST = 16
"""Least number of hex digits of an anchor. No one can make a second log with sixteen equal digits."""


def anchor_of(seal: Seal | None) -> str:
    """Return a session's anchor, the link of its last event; empty without a seal."""
    return "" if seal is None or seal.log is None else seal.log.sha256


def links_of(folder: Path) -> tuple[str, ...]:
    """Return every anchor that a session ever had, from its files."""
    log = read_event_log(folder, [])
    return () if log is None else log.links


def sealed_at(folder: Path) -> dict[tuple[str, str, int], datetime]:
    """Return each run's time of sealing, by test, direction and repeat, if the event log contains it."""
    log, found = read_event_log(folder, []), dict[tuple[str, str, int], datetime]()
    for event in () if log is None else log.events:
        for run in (*event.runs, *(event.all_runs or ())):
            if event.at is not None and run.get("chain_sha256"):
                found.setdefault(run_key(run), event.at)
    return found


def impossible_day(at: datetime) -> str:
    """Return the day of a run and why it is impossible; empty if it is possible."""
    if at > datetime.now(UTC) + timedelta(days=1):  # zones differ by up to 26 hours
        return f"{at:%Y-%m-%d}, which is still to come"
    return f"{at:%Y-%m-%d}, before there were ball bars" if at.year < FIRST_BARS else ""


FIRST_BARS = 1982
"""Year of the first paper on the magnetic ball bar [Bryan 1982]. A clock at zero gives 1970, a spreadsheet 1900."""


def anchor_told(folder: Path, anchor: str) -> Problem:
    """Return the changes since a noted anchor, with a remedy."""
    log = read_event_log(folder, [])
    events = () if log is None else log.events
    for number, event in enumerate(events, start=1):
        if event.link.startswith(anchor):
            when = "" if event.at is None else f", {event.at:%Y-%m-%d %H:%M %Z}"
            what = f"the anchor {anchor[:SHORTEST]} is event {number} of {len(events)}{when}: nothing before it was changed"
            return Problem.of(folder, what)
    what = f"the anchor {anchor[:SHORTEST]} is not in this session: it is another one, or was written anew since"
    return Problem.of(folder, what, "compare it with a backup")
