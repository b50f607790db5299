"""Events of the sequencer for storage, screens and command line: data, in order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.facts import OfRun
from dbbstation.quality.answer import answer

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.errors import StationError
    from dbbstation.instrument.reading import Status
    from dbbstation.plan.plan import Ball, Circle, Direction
    from dbbstation.plan.sampling import SampledCircle
    from dbbstation.quality.answer import RunAssessment
    from dbbstation.quality.finding import Finding
    from dbbstation.station.commands import Command
    from dbbstation.station.states import State
    from dbbstation.trace.analysis import CircleFigures


@dataclass(frozen=True)
class RunId(OfRun):
    """Identity of a run in its session.

    Attributes:
        repeat: from 1.
        mounting: number of the ball's set-up in the session, from 1.
    """

    direction: Direction
    mounting: int


@dataclass(frozen=True)
class Sample:
    """One reading for the sequencer.

    Attributes:
        t_s: machine time: while recording, since the first sample; else of the driver's clock.
        status: `ok`, `doubtful`, `overrange` or `fault`.
        phi_deg: live progress: 0 to 360 on the full turn, negative before it, above 360 after it; None off the circle.
        t_uncertainty_s: standard uncertainty of `t_s`; None if the instrument sends by itself.
    """

    t_s: float
    length_mm: float | None
    status: Status = "ok"
    said: str = ""
    lost: int = 0
    phi_deg: float | None = None
    t_uncertainty_s: float | None = None


@dataclass(frozen=True)
class Event:
    """Something that happened at the station."""


@dataclass(frozen=True)
class StateChanged(Event):
    """The sequencer is in another state."""

    state: State
    commands: frozenset[type[Command]]


@dataclass(frozen=True)
class OfTheRun(Event):
    """An event of a run."""

    run: RunId


@dataclass(frozen=True)
class RunAnnounced(OfTheRun):
    """The next run and its set-up.

    Attributes:
        put_up: whether the ball must be put up; otherwise it stays untouched.
        sampling: what the instrument sees at this feed; None if its rate is not known.
    """

    ball: Ball
    circle: Circle
    put_up: bool
    program: str
    number: int
    count: int
    instructions: tuple[str, ...]
    sampling: SampledCircle | None = None


@dataclass(frozen=True)
class ReadingsSeen(Event):
    """Readings outside a run, in time order, for a live display."""

    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class RunStarted(OfTheRun):
    """The bar is outside the circle. All following samples belong to the run."""

    program: str


@dataclass(frozen=True)
class SamplesRecorded(OfTheRun):
    """Samples of the current run, in time order."""

    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class FeedInSeen(OfTheRun):
    """The bar has entered the circle."""


@dataclass(frozen=True)
class RunProgress(OfTheRun):
    """Progress of the run, at most once per degree."""

    swept_deg: float
    of_deg: float


@dataclass(frozen=True)
class RunCompleted(OfTheRun):
    """The recording has ended.

    Attributes:
        problem: why it is unusable; empty if usable.
        doubtful: possibly damaged samples, kept but unused.
        to_come: circles of the plan that are still to be measured.
        counts_beside: another accepted run of the same test and direction, which counts too; or None.
    """

    samples: int
    lost: int
    figures: CircleFigures | None
    problem: str
    findings: tuple[Finding, ...] = ()
    doubtful: int = 0
    to_come: int = 0
    counts_beside: RunId | None = None

    @property
    def answer(self) -> RunAssessment:
        """Return the run's word and its cause."""
        return answer(self.findings, "" if self.figures is not None else self.problem or "no circle", self.to_come)

    @property
    def wrong(self) -> tuple[Finding, ...]:
        """Return findings beyond their limit."""
        return tuple(finding for finding in self.findings if finding.wrong)


@dataclass(frozen=True)
class RunDoubted(OfTheRun):
    """The circle just completed shows that an accepted run contradicts the others."""

    finding: Finding


@dataclass(frozen=True)
class RunRestored(OfTheRun):
    """An older run still awaits its verdict."""

    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class FeedInMissed(OfTheRun):
    """The machine is on the circle, but no run is being recorded."""

    problem: str


@dataclass(frozen=True)
class Noted(Event):
    """A note or a temperature was added."""

    text: str
    ambient_temp_c: float | None


@dataclass(frozen=True)
class RunAccepted(OfTheRun):
    """The run counts.

    Attributes:
        beside: an accepted run of the same test and direction that counts too.
    """

    reason: str = ""
    beside: RunId | None = None


@dataclass(frozen=True)
class RunRejected(OfTheRun):
    """The run does not count; its recording is kept."""

    reason: str


@dataclass(frozen=True)
class RunLate(OfTheRun):
    """The machine did not start; the run is announced again."""

    problem: str


@dataclass(frozen=True)
class CommandRefused(Event):
    """The present state does not allow a command; it had no effect."""

    why: str


@dataclass(frozen=True)
class SessionFinished(Event):
    """The sequence is finished."""

    accepted: int
    missing: tuple[str, ...]


@dataclass(frozen=True)
class SessionStopped(Event):
    """The user ended the sequence.

    Attributes:
        left_to_do: planned runs without an accepted one.
        interrupted: run whose recording was cut short and kept; or None.
    """

    accepted: int
    left_to_do: int
    interrupted: RunId | None


@dataclass(frozen=True)
class Fault(Event):
    """Instrument or storage failed and the sequence ends; recordings are kept."""

    error: StationError
    interrupted: RunId | None


Observer: TypeAlias = "Callable[[Event], None]"
"""Function that is called with each event in the sequence's thread. An exception in it ends the sequence."""
