"""Collect events into the state that a screen draws."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.plan.plan import Direction
from dbbstation.service.held_line import ReadingRate
from dbbstation.service.live_trace import LiveTrace, View, difference
from dbbstation.station import events
from dbbstation.station.states import RECORDING, State

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.plan.plan import Circle
    from dbbstation.service.live_trace import Derived
    from dbbstation.station.commands import Command
    from dbbstation.station.judging import JudgedRun
    from dbbstation.station.schedule import Task
    from dbbstation.trace.analysis import CircleFigures


class Weight(StrEnum):
    """Importance of a message."""

    NOTE = "note"
    WARNING = "warning"
    FAULT = "fault"


@dataclass(frozen=True)
class Message:
    """A message for the operator."""

    weight: Weight
    text: str


def message_of(event: object) -> Message | None:  # noqa: C901, PLR0911 - a line per event, nothing nested
    """Return an event's message, or None."""
    match event:
        case events.RunAccepted(beside=beside) if beside is not None:
            return Message(Weight.WARNING, f"{event.run.label} accepted; {beside.label} counts too")
        case events.RunAccepted():
            return Message(Weight.NOTE, f"{event.run.label} accepted")
        case events.RunRejected():
            return Message(Weight.NOTE, f"{event.run.label} does not count, its recording is kept: {event.reason}")
        case events.RunCompleted() if event.wrong:
            return Message(
                Weight.WARNING, f"{event.run.label}: " + "; ".join(f"{f.name}: {f.text}" for f in event.wrong)
            )
        case events.RunCompleted(problem=problem) if problem:
            return Message(Weight.WARNING, f"{event.run.label}: {problem_alone(event)}")
        case events.RunDoubted():
            return Message(Weight.WARNING, f"{event.run.label} is doubted: {event.finding.text}")
        case events.RunRestored():
            return Message(Weight.NOTE, f"{event.run.label} was recorded before and waits for its verdict")
        case events.RunLate() | events.FeedInMissed():
            return Message(Weight.WARNING, f"{event.run.label}: {event.problem}")
        case events.CommandRefused():
            return Message(Weight.WARNING, event.why)
        case events.Noted():
            degc = "" if event.ambient_temp_c is None else f"{event.ambient_temp_c:g} °C"
            return Message(Weight.NOTE, f"noted: {event.text or degc}")
        case events.SessionStopped():
            return Message(Weight.NOTE, f"stopped; {event.left_to_do} runs are left to do")
        case events.Fault():
            return Message(Weight.FAULT, str(event.error))
    return None


def problem_alone(completed: events.RunCompleted) -> str:
    """Return a run's problem without the run's name."""
    return completed.problem.removeprefix(f"{completed.run.label}: ")


_MESSAGES = 50


class Mark(StrEnum):
    """State of a planned run, as the text beside its sign."""

    OPEN = "open"
    NEXT = "next"
    RUNNING = "running"
    COMPLETE = "verdict?"
    FLAWED = "no circle"
    ACCEPTED = "accepted"
    PASSED = "left out"


class RunDecision(StrEnum):
    """Decision on a recorded run, as the shown text."""

    NONE = ""
    ACCEPTED = "accepted"
    REJECTED = "rejected"


@dataclass(frozen=True)
class SequenceOpened:
    """Instrument and session are ready; the runner's first event."""

    tasks: tuple[Task, ...]
    open: tuple[Task, ...]
    session: str
    known: tuple[JudgedRun, ...] = ()
    virtual: bool = False


_RUN_MARKS = {
    State.ANNOUNCED: Mark.NEXT,
    State.ARMED: Mark.NEXT,
    State.DWELLING: Mark.RUNNING,
    State.TURNING: Mark.RUNNING,
    State.LEAVING: Mark.RUNNING,
    State.COMPLETE: Mark.COMPLETE,
    State.FLAWED: Mark.FLAWED,
}
"""Mark of the announced run in each state."""


@dataclass
class Board:
    """The state that the screen draws.

    Attributes:
        lost: samples lost in the latest run.
        doubtful: possibly damaged samples of that run.
        swept_deg: angle since the feed-in.
        traces: of the last started test, by direction.
        last: that test's circles in the previous session, by direction; may be empty.
        difference: difference of both directions; None before both are complete.
        running: direction on its circle, or None.
        completed: run awaiting its verdict, or the last one.
        doubted: accepted runs that contradict the others, by name.
        temperature_due: whether a run began since the last temperature.
    """

    state: State | None = None
    allowed: frozenset[type[Command]] = frozenset()
    announced: events.RunAnnounced | None = None
    tasks: tuple[Task, ...] = ()
    marks: list[Mark] = field(default_factory=list)
    session: str = ""
    virtual: bool = False
    sample: events.Sample | None = None
    rate: ReadingRate = field(default_factory=ReadingRate)
    lost: int = 0
    doubtful: int = 0
    swept_deg: float = 0.0
    traces: dict[Direction, LiveTrace] = field(default_factory=dict)
    last: Mapping[Direction, LiveTrace] = field(default_factory=dict)
    difference: Derived | None = None
    running: Direction | None = None
    results: deque[events.RunCompleted] = field(default_factory=lambda: deque(maxlen=2))
    runs: dict[str, events.RunCompleted] = field(default_factory=dict)
    verdicts: dict[str, RunDecision] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    completed: events.RunCompleted | None = None
    doubted: dict[str, events.RunDoubted] = field(default_factory=dict)
    fault: events.Fault | None = None
    finished: events.SessionFinished | None = None
    temperature_due: bool = False
    messages: deque[Message] = field(default_factory=lambda: deque(maxlen=_MESSAGES))

    @property
    def circle(self) -> Circle | None:
        """Return the circle of the traces, else the announced circle, or None."""
        announced = self.announced.circle if self.announced else None
        return next((trace.circle for trace in self.traces.values()), announced)

    @property
    def views(self) -> dict[View, Mapping[Direction, LiveTrace | Derived]]:
        """Return the possible views: always the measured one; others if a circle is complete and none is running."""
        views: dict[View, Mapping[Direction, LiveTrace | Derived]] = {View.MEASURED: self.traces}
        if self.state in RECORDING:
            return views
        centred = {way: trace.centred for way, trace in self.traces.items() if trace.centred is not None}
        if centred:
            views[View.CENTRED] = centred
        if self.difference is not None:
            views[View.DIFFERENCE] = {Direction.CCW: self.difference}
        return views

    @property
    def beneath(self) -> dict[View, Mapping[Direction, LiveTrace | Derived]]:
        """Return the former session's traces in the drawn directions, if they are of the same test and no difference is drawn."""
        views = self.views
        mine = {way: one for way, one in self.last.items() if one.run.test == self.test}
        return {
            View.MEASURED: {way: one for way, one in mine.items() if way in views[View.MEASURED]},
            View.CENTRED: {
                way: one.centred
                for way, one in mine.items()
                if one.centred is not None and way in views.get(View.CENTRED, {})
            },
        }

    @property
    def test(self) -> str:
        """Return the test of the traces, else the announced test; may be empty."""
        announced = self.announced.run.test if self.announced else ""
        return next((trace.run.test for trace in self.traces.values()), announced)

    @property
    def accepted(self) -> int:
        """Return the number of planned runs with an accepted recording."""
        return self.marks.count(Mark.ACCEPTED)

    @property
    def left(self) -> tuple[Task, ...]:
        """Return planned runs without accepted recording."""
        return tuple(task for task, mark in zip(self.tasks, self.marks, strict=True) if mark is not Mark.ACCEPTED)

    def marks_of(self, test: str) -> list[tuple[Task, Mark]]:
        """Return the planned runs of a test with their marks."""
        return [(task, mark) for task, mark in zip(self.tasks, self.marks, strict=True) if task.test == test]

    def in_doubt(self, test: str, direction: Direction) -> bool:
        """Return whether an accepted run of a test and direction contradicts the others."""
        return any((one.run.test, one.run.direction) == (test, direction) for one in self.doubted.values())

    def runs_of(self, test: str, direction: Direction) -> tuple[events.RunCompleted, ...]:
        """Return a test's runs in a direction, in recording order."""
        mine = [one for one in self.runs.values() if (one.run.test, one.run.direction) == (test, direction)]
        return tuple(sorted(mine, key=lambda one: one.run.repeat))

    def figures_of(self, test: str, direction: Direction) -> CircleFigures | None:
        """Return figures of the last run with a circle that was not rejected."""
        standing = [
            one.figures
            for one in self.runs_of(test, direction)
            if one.figures is not None and self.verdicts.get(one.run.label) is not RunDecision.REJECTED
        ]
        return standing[-1] if standing else None

    def take(self, event: events.Event | SequenceOpened) -> None:  # noqa: C901, PLR0912 - a line per event, nothing nested
        """Process an event."""
        message = message_of(event)
        if message is not None:
            self.messages.append(message)
        match event:
            case events.SamplesRecorded() | events.ReadingsSeen():
                self._samples(event)
            case events.RunProgress():
                self.swept_deg = event.swept_deg
            case events.StateChanged():
                self._enter(event)
            case events.RunAnnounced():
                self.announced, self.swept_deg = event, 0.0
            case events.RunStarted():
                self._begin(event.run)
                self.temperature_due = True
            case events.Noted() if event.ambient_temp_c is not None:
                self.temperature_due = False
            case events.RunCompleted():
                self.doubted = {}
                self._complete(event)
            case events.RunDoubted():
                self.doubted[event.run.label] = event
                known = self.runs.get(event.run.label)
                if known is not None:
                    self.runs[event.run.label] = replace(known, findings=(event.finding, *known.findings))
            case events.RunRestored():
                self._begin(event.run)
                self._trace(event.run, event.samples)
            case events.RunAccepted():
                self._judge(event.run, RunDecision.ACCEPTED, event.reason)
            case events.RunRejected():
                self._judge(event.run, RunDecision.REJECTED, event.reason)
            case events.SessionFinished():
                self.finished = event
            case events.Fault():
                self.fault = event
            case SequenceOpened():
                self._open(event)
            case _:
                pass

    def _open(self, opened: SequenceOpened) -> None:
        self.tasks, self.session, self.virtual = opened.tasks, opened.session, opened.virtual
        self.marks = [Mark.OPEN if task in opened.open else Mark.ACCEPTED for task in opened.tasks]
        for known in opened.known:
            label = known.completed.run.label
            self.runs[label], self.reasons[label] = known.completed, known.reason
            self.verdicts[label] = RunDecision.ACCEPTED if known.accepted else RunDecision.REJECTED
        if self.fault is not None:
            # What is over does not stay red.
            past = [replace(message, weight=Weight.NOTE) for message in self.messages]
            self.messages.clear()
            self.messages.extend(past)
            self.messages.append(Message(Weight.NOTE, "connected again; what was recorded before stays"))
        self.fault = self.finished = self.sample = None
        self.rate.forget()

    def _enter(self, event: events.StateChanged) -> None:
        before, self.state, self.allowed = self.state, event.state, event.commands
        accepted = self._announced_mark is Mark.ACCEPTED
        if event.state is State.BETWEEN and before in _RUN_MARKS and not accepted:
            self._mark(Mark.PASSED)
        elif event.state in {State.STOPPED, State.FAULTED} and not accepted:
            self._mark(Mark.OPEN)
        elif event.state in _RUN_MARKS:
            self._mark(_RUN_MARKS[event.state])
        self.running = self.announced.run.direction if self.announced and event.state is State.TURNING else None

    @property
    def _announced_mark(self) -> Mark | None:
        number = self.announced.number - 1 if self.announced else -1
        return self.marks[number] if 0 <= number < len(self.marks) else None

    def _mark(self, mark: Mark) -> None:
        if self._announced_mark is not None and self.announced is not None:
            self.marks[self.announced.number - 1] = mark

    def _begin(self, run: events.RunId) -> None:
        if self.announced is None:
            return
        if any(trace.run.test != run.test for trace in self.traces.values()):
            self.traces = {}
        # A repeated test at the end of the plan is compared with itself, not with the turn of hours ago.
        self.traces = {
            direction: trace
            for direction, trace in self.traces.items()
            if direction is not run.direction and trace.run.mounting == run.mounting
        }
        self.traces[run.direction] = LiveTrace(run, self.announced.circle)
        self.lost, self.doubtful, self.swept_deg, self.difference = 0, 0, 0.0, None

    def _complete(self, completed: events.RunCompleted) -> None:
        self.completed = self.runs[completed.run.label] = completed
        if completed.figures is not None:
            self.results.append(completed)
            trace = self.traces.get(completed.run.direction)
            if trace is not None:
                trace.centre()
            both = (self.traces.get(way) for way in (Direction.CCW, Direction.CW))
            ccw, cw = (None if one is None else one.centred for one in both)
            self.difference = None if ccw is None or cw is None else difference(ccw, cw)

    def _judge(self, run: events.RunId, verdict: RunDecision, reason: str = "") -> None:
        self.verdicts[run.label], self.reasons[run.label] = verdict, reason
        if verdict is RunDecision.REJECTED:
            self.doubted.pop(run.label, None)
        announced = self.announced.run if self.announced else None
        if announced is not None and announced.label == run.label:
            if verdict is RunDecision.ACCEPTED:
                self._mark(Mark.ACCEPTED)
        else:
            self._mark_earlier(run, verdict)
        if verdict is RunDecision.REJECTED:
            trace = self.traces.get(run.direction)
            if trace is not None and trace.run.label == run.label:
                del self.traces[run.direction]
                self.difference = None

    def _mark_earlier(self, run: events.RunId, verdict: RunDecision) -> None:
        mine = [k for k, task in enumerate(self.tasks) if (task.test, task.direction) == (run.test, run.direction)]
        if verdict is RunDecision.ACCEPTED:
            changed = next((k for k in mine if self.marks[k] is not Mark.ACCEPTED), None)
        else:
            changed = next((k for k in reversed(mine) if self.marks[k] is Mark.ACCEPTED), None)
        if changed is not None:
            self.marks[changed] = Mark.ACCEPTED if verdict is RunDecision.ACCEPTED else Mark.OPEN

    def _trace(self, run: events.RunId, samples: Sequence[events.Sample]) -> None:
        trace = self.traces.get(run.direction)
        if trace is not None:
            trace.add(samples)

    def _samples(self, event: events.SamplesRecorded | events.ReadingsSeen) -> None:
        samples: Sequence[events.Sample] = event.samples
        if isinstance(event, events.SamplesRecorded):
            self.lost += sum(sample.lost for sample in samples)
            self.doubtful += sum(sample.status == DOUBTFUL for sample in samples)
            self._trace(event.run, samples)
        self.rate.add(samples)
        self.sample = samples[-1]
