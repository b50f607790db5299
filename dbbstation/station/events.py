"""What the sequencer tells whoever listens: storage, screens, the command line. Data only, in the order it happened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dbbstation.quality.answer import answer

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.errors import StationError
    from dbbstation.instrument.reading import Status
    from dbbstation.plan.circle import Circle, Direction
    from dbbstation.plan.plan import Ball
    from dbbstation.plan.sampling import Sampling
    from dbbstation.quality.answer import RunAssessment
    from dbbstation.quality.finding import Finding
    from dbbstation.station.commands import Command
    from dbbstation.station.states import State
    from dbbstation.trace.analysis import CircleFigures


@dataclass(frozen=True)
class RunId:
    """Which run of the session.

    Attributes:
        direction: sense of travel.
        repeat: counts the runs of this test and direction in the session, from 1.
        mounting: counts how often a ball was put up in the session, from 1.
    """

    test: str
    direction: Direction
    repeat: int
    mounting: int

    @property
    def label(self) -> str:
        """Name of the run in messages and of its file, such as `a-ccw-1`."""
        return f"{self.test}-{self.direction}-{self.repeat}"


@dataclass(frozen=True)
class Sample:
    """One reading, as seen by the sequencer.

    Attributes:
        t_s: machine time; since the run's first sample while a run is recorded, of the driver's clock before [s].
        length_mm: distance between the ball centres [mm]; None where the instrument gave no number.
        status: `ok`, `doubtful`, `overrange` or `fault`.
        said: what the instrument said where the status is not `ok`; why it is doubted where it is `doubtful`.
        phi_deg: progress along the turn as far as it can be told live, 0 to 360 on the full turn, negative on the overshoot
            before it, above 360 behind it [deg]; None off the circle.
        t_uncertainty_s: standard uncertainty of `t_s` [s]; None where the instrument sends by itself.
    """

    t_s: float
    length_mm: float | None
    status: Status = "ok"
    said: str = ""
    lost: int = 0
    phi_deg: float | None = None
    t_uncertainty_s: float | None = None


@dataclass(frozen=True)
class StateChanged:
    """The sequencer is in another state.

    Attributes:
        commands: what it takes now.
    """

    state: State
    commands: frozenset[type[Command]]


@dataclass(frozen=True)
class RunAnnounced:
    """What is measured next, and what a person has to do for it.

    Attributes:
        ball: the ball on the table with its bore (None: it stands in none) and holder, or put up under the spindle.
        circle: the circle: bar length, tilt, elevation, feed, centre.
        put_up: the ball has to be put up; otherwise it stands there already and is not touched.
        program: NC program that commands the run; empty: the plain nominal circle.
        number: of the run in the sequence, from 1.
        instructions: the same in words, one step per entry.
        sampling: what the instrument sees of the circle at its feed; None where its rate is not known.
    """

    run: RunId
    ball: Ball
    circle: Circle
    put_up: bool
    program: str
    number: int
    count: int
    instructions: tuple[str, ...]
    sampling: Sampling | None = None


@dataclass(frozen=True)
class ReadingsSeen:
    """Readings in time order, while no run is recorded: for a live display only."""

    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class RunStarted:
    """The bar stands outside the circle: from now on every sample belongs to the run.

    Attributes:
        program: NC program that commands it; empty: the plain nominal circle.
    """

    run: RunId
    program: str


@dataclass(frozen=True)
class SamplesRecorded:
    """Samples of the run that goes on, in time order."""

    run: RunId
    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class FeedInSeen:
    """The bar came onto the circle.

    Attributes:
        t_s: since the run's first sample [s].
    """

    run: RunId
    t_s: float


@dataclass(frozen=True)
class RunProgress:
    """How far the run is; sent once per degree at most.

    Attributes:
        swept_deg: travelled since the feed-in [deg].
        of_deg: from feed-in to feed-out, both overshoots included [deg].
    """

    run: RunId
    swept_deg: float
    of_deg: float


@dataclass(frozen=True)
class RunCompleted:
    """The recording has ended, nothing is added to it any more.

    Attributes:
        lost: samples that the line lost during it.
        problem: why it cannot be used; empty where it can.
        findings: all that was looked for in its circle; empty where it has none.
        doubtful: samples that may have been damaged on the line; they are kept, and in no figure.
    """

    run: RunId
    samples: int
    lost: int
    figures: CircleFigures | None
    problem: str
    findings: tuple[Finding, ...] = ()
    doubtful: int = 0

    @property
    def answer(self) -> RunAssessment:
        """The run in one word, and what caused it."""
        return answer(self.findings, "" if self.figures is not None else self.problem or "no circle")

    @property
    def wrong(self) -> tuple[Finding, ...]:
        """Findings that pass their limit: reasons to measure the run again."""
        return tuple(finding for finding in self.findings if finding.wrong)


@dataclass(frozen=True)
class RunRestored:
    """A run that was recorded before waits for its verdict still; its figures follow as those of any completed run.

    Attributes:
        samples: of its turn, in time order, thinned; empty where it has none.
    """

    run: RunId
    samples: tuple[Sample, ...]


@dataclass(frozen=True)
class FeedInMissed:
    """The machine is on the circle, and nothing is recorded."""

    run: RunId
    problem: str


@dataclass(frozen=True)
class Noted:
    """Somebody noted something.

    Attributes:
        text: the remark; empty for a temperature alone.
        ambient_temp_c: temperature of the shop now [degC]; None where it was not read.
    """

    text: str
    ambient_temp_c: float | None


@dataclass(frozen=True)
class RunAccepted:
    """The run counts.

    Attributes:
        reason: why, although something was found wrong with it; empty where nothing was.
    """

    run: RunId
    reason: str = ""


@dataclass(frozen=True)
class RunRejected:
    """The run does not count; its recording is kept."""

    run: RunId
    reason: str


@dataclass(frozen=True)
class RunLate:
    """The machine did not come: no recording was begun, the run is announced again.

    Attributes:
        problem: what was waited for and how long.
    """

    run: RunId
    problem: str


@dataclass(frozen=True)
class CommandRefused:
    """A command that the state does not take; nothing happened.

    Attributes:
        why: in words, with what can be done instead.
    """

    command: Command
    state: State
    why: str


@dataclass(frozen=True)
class SessionFinished:
    """The sequence is through.

    Attributes:
        accepted: runs that count, of the whole session.
        missing: test and direction of every planned run that has no accepted recording.
    """

    accepted: int
    missing: tuple[str, ...]


@dataclass(frozen=True)
class SessionStopped:
    """Somebody quit.

    Attributes:
        accepted: runs that count, of the whole session.
        left_to_do: planned runs that have no accepted recording.
        interrupted: the run that went on, kept as far as it came; None where none did.
    """

    accepted: int
    left_to_do: int
    interrupted: RunId | None


@dataclass(frozen=True)
class Fault:
    """Instrument or storage failed; the sequence ends here. What was recorded is kept.

    Attributes:
        interrupted: the run that went on, kept as far as it came; None where none did.
    """

    error: StationError
    interrupted: RunId | None


Event: TypeAlias = (
    StateChanged
    | RunAnnounced
    | ReadingsSeen
    | RunStarted
    | SamplesRecorded
    | FeedInSeen
    | RunProgress
    | RunCompleted
    | RunRestored
    | FeedInMissed
    | Noted
    | RunAccepted
    | RunRejected
    | RunLate
    | CommandRefused
    | SessionFinished
    | SessionStopped
    | Fault
)

Observer: TypeAlias = "Callable[[Event], None]"
"""Called with each event in the thread that runs the sequence; what it raises ends the sequence."""
