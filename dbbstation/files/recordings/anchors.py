"""Anchors: the hash of a session's last event, noted elsewhere, reveals later changes."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from dbbstation.errors import Problem
from dbbstation.files.recordings.event_log import read_event_log, run_key

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.formats.session import Seal

SHORTEST = 16
"""Least number of hex digits of an anchor: nobody can make another log with the same sixteen digits."""


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
            return Problem(str(folder), 0, 0, what)
    what = f"the anchor {anchor[:SHORTEST]} is not in this session: it is another one, or was written anew since"
    return Problem(str(folder), 0, 0, what, "compare it with a backup")
