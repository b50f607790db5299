"""Anchors: the link of a session's last event, noted elsewhere, reveals later changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import Problem
from dbbstation.files.recordings.event_log import read_event_log

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.recordings.seal import Seal

SHORTEST = 16
"""Hex digits of an anchor that are enough: nobody finds another log with the same sixteen."""


def anchor_of(seal: Seal | None) -> str:
    """Return a session's anchor, its last event; empty without a seal."""
    return "" if seal is None else seal.anchor


def links_of(folder: Path) -> tuple[str, ...]:
    """Return every anchor that a session has had, by its files."""
    log = read_event_log(folder, [])
    return () if log is None else log.links


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
