"""What is in a session: the results of `session list`, `session log` and `simulate`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class SampleCounts:
    """What became of the samples of a run.

    Attributes:
        received: how many came.
        lost: how many did not.
        rejected: how many were not used, by the reason.
    """

    received: int
    lost: int
    rejected: Mapping[str, int]


@dataclass(frozen=True)
class ListedRun:
    """A run of a session.

    Attributes:
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        mounting: of the ball; None where nobody counted.
        started: ISO 8601; None where not noted.
        reason: why; None for none.
        file: of its recording, in the session's folder.
    """

    run: str
    test: str
    direction: str
    repeat: int
    mounting: int | None
    started: str | None
    state: str
    reason: str | None
    counts: SampleCounts | None
    file: str


@dataclass(frozen=True)
class ListedSession:
    """The runs of a session.

    Attributes:
        missing: circles of its plan that have no accepted run.
    """

    session: str
    runs: tuple[ListedRun, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True)
class ListedEvent:
    """An event of a session.

    Attributes:
        at: when, ISO 8601; None where that is not known.
        about: runs or keys of the session file that it is about.
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
        events: in their order.
        anchor: link of the last; None without a log.
    """

    session: str
    events: tuple[ListedEvent, ...]
    anchor: str | None


@dataclass(frozen=True)
class SimulatedSession:
    """A session that was simulated.

    Attributes:
        tests: of the plan that were run.
    """

    session: str
    runs: int
    tests: tuple[str, ...]
