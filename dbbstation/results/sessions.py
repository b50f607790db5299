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
        run: its name.
        test: name of its test.
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        mounting: of the ball; None where nobody counted.
        started: ISO 8601; None where not noted.
        state: what was decided of it.
        reason: why; None for none.
        counts: of its samples; None where not noted.
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
        session: its name.
        runs: that it has.
        missing: circles of its plan that have no accepted run.
    """

    session: str
    runs: tuple[ListedRun, ...]
    missing: tuple[str, ...]


@dataclass(frozen=True)
class ListedEvent:
    """An event of a session.

    Attributes:
        event: its number.
        at: when, ISO 8601; None where that is not known.
        what: what happened.
        about: runs or keys of the session file that it is about.
        link: of the event in the chain.
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
        session: its name.
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
        session: its folder.
        runs: how many it has.
        tests: of the plan that were run.
    """

    session: str
    runs: int
    tests: tuple[str, ...]
