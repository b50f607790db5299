"""The results of `session list`, `session log` and `simulate`."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.files.recordings.entries import Counts


@dataclass(frozen=True)
class ListedRun:
    """A run of a session.

    Attributes:
        mounting: of the ball; None if not counted.
        started: ISO 8601; None if not noted.
        reason: or None.
        file: in the session's folder.
    """

    run: str
    test: str
    direction: str
    repeat: int
    mounting: int | None
    started: str | None
    state: str
    reason: str | None
    counts: Counts | None
    file: str


@dataclass(frozen=True)
class ListedSession:
    """The runs of a session.

    Attributes:
        missing: planned circles without accepted run.
    """

    session: str
    runs: tuple[ListedRun, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True)
class ListedEvent:
    """An event of a session.

    Attributes:
        at: ISO 8601; None if unknown.
        about: its runs or keys of the session file.
    """

    event: int
    at: str | None
    what: str
    about: str
    link: str


@dataclass(frozen=True)
class SessionEvents:
    """The event log of a session.

    Attributes:
        events: in order.
        anchor: last link; None without a log.
    """

    session: str
    events: tuple[ListedEvent, ...]
    anchor: str | None


@dataclass(frozen=True)
class SimulatedSession:
    """A simulated session."""

    session: str
    runs: int
    tests: tuple[str, ...]
