"""Dialogue of `measure`."""

from __future__ import annotations

import logging
import sys
import threading
from typing import TYPE_CHECKING, TextIO

from dbbstation.cli.output import echo, log_said
from dbbstation.cli.progress import COUNTED, ProgressBar
from dbbstation.facts import of_facts
from dbbstation.results.sessions import CompletedRun, MeasuredSession, RecordedRun
from dbbstation.service.board import message_of
from dbbstation.service.session_notes import shop_degc
from dbbstation.station import events
from dbbstation.station.commands import Accept, AddNote, GoTo, Pause, Quit, Reject, Repeat, Resume, Skip, Start
from dbbstation.station.states import State

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.files.formats.session import RunEntry
    from dbbstation.station.assembly import Workplace
    from dbbstation.station.commands import Command

_LOG = logging.getLogger(__name__)

_OF_MACHINE, _OF_SET_UP = "centre", "set-up"
"""Titles of a circle's centre. For balls under the spindle it shows the set-up of the balls, not the machine."""

_ON_ENTER: dict[State, Command] = {
    State.ANNOUNCED: Start(),
    State.FLAWED: Repeat(),
    State.PAUSED: Resume(),
}
_WORDS: dict[str, Command] = {
    "m": Start(remounted=True),
    "a": Accept(),
    "r": Repeat(),
    "x": Reject(),
    "s": Skip(),
    "p": Pause(),
    "q": Quit(),
}
_ASKED = {
    State.ANNOUNCED: "Enter: ready, start the circle   m: ready, the holder was touched   s: skip   g TEST: go to   n TEXT: note   t 20.5: temperature   p: pause   q: quit",
    State.COMPLETE: "Enter: accept   r: repeat   x: reject   q: quit",
    State.FLAWED: "Enter: repeat   x: reject   q: quit",
    State.PAUSED: "Enter: go on   q: quit",
}

_ASKED_TO_GO_BACK = "Enter: go back to the circle that is wrong   a WHY: accept this one, leave it   q: quit"
_ASKED_OF_WRONG = "Enter: repeat   a WHY: accept all the same   x: reject   q: quit"


class _Doubts:
    """What is wrong with the last circle, or with earlier ones."""

    _wrong = _back = False

    def doubt(self, event: events.Event) -> None:
        """Note what an event says of it."""
        if isinstance(event, events.RunCompleted):
            self._wrong, self._back = bool(event.wrong), False
        self._back = self._back or isinstance(event, events.RunDoubted)


class Talk(_Doubts):
    """Prints the events for the operator; an observer."""

    def __init__(self, *, asking: bool) -> None:
        self._asking = asking
        self._bar = ProgressBar("  recording", COUNTED, unit="°", passing=True)
        self._centre = _OF_MACHINE

    def __call__(self, event: events.Event) -> None:
        """Show an event."""
        if isinstance(event, events.RunAnnounced):
            self._centre = _OF_MACHINE if event.ball.place_known else _OF_SET_UP
        if isinstance(event, events.RunProgress):
            self._bar.show(min(event.swept_deg, event.of_deg), event.of_deg, at_once=False)
            return
        lines = _lines(event, self._centre)
        if lines:
            self._bar.end()
        for line in lines:
            echo(line, err=True)
        self.doubt(event)
        if self._asking and isinstance(event, events.StateChanged) and event.state in _ASKED:
            of_wrong = _ASKED_TO_GO_BACK if self._back else _ASKED_OF_WRONG
            doubtful = (self._wrong or self._back) and event.state is State.COMPLETE
            echo(f"  {of_wrong if doubtful else _ASKED[event.state]}", err=True)

    def end(self) -> None:
        """Remove the progress bar, however the sequence ended."""
        self._bar.end()


class Log:
    """Logs events; an observer."""

    def __call__(self, event: events.Event) -> None:
        """Log an event."""
        for line in _lines(event, _OF_MACHINE):
            log_said(line.strip())
        if isinstance(event, events.Fault):
            _LOG.error("%s", event.error)


class Summary:
    """Collects the output of `--json`; an observer."""

    def __init__(self) -> None:
        self._completed: dict[str, events.RunCompleted] = {}
        self._fault = ""

    def __call__(self, event: events.Event) -> None:
        """Collect figures of runs, and faults."""
        if isinstance(event, events.RunCompleted):
            self._completed[event.run.label] = event
        elif isinstance(event, events.Fault):
            self._fault = str(event.error)

    def of(self, workplace: Workplace) -> MeasuredSession:
        """Return the session with figures of new runs."""
        session, schedule = workplace.writer.session, workplace.schedule
        return MeasuredSession(
            session=str(session.folder),
            state=workplace.station.state.name.lower(),
            fault=self._fault or None,
            planned=len(schedule.tasks),
            accepted=schedule.accepted,
            missing=tuple(task.text for task in schedule.open),
            runs=tuple(self._run(run) for run in session.runs),
        )

    def _run(self, run: RunEntry) -> RecordedRun:
        recorded = of_facts(
            RecordedRun,
            run,
            direction=run.direction.value,
            state=run.state.value,
            file=f"runs/{run.path.name}",
        )
        completed = self._completed.get(run.name)
        if completed is None:
            return recorded
        return of_facts(
            CompletedRun,
            recorded,
            completed,
            completed.figures,
            problem=completed.problem or None,
            findings=tuple(completed.findings),
        )


class Keyboard(_Doubts):
    """Turns input lines into commands by the station's state; an observer."""

    def __init__(self, send: Callable[[Command], None], lines: TextIO | None = None) -> None:
        self._send = send
        self._lines = lines or sys.stdin
        self._state = State.BETWEEN
        # A thread that waits for a line cannot be woken; as a daemon it ends with the program.
        self._thread = threading.Thread(target=self._listen, name="keyboard", daemon=True)

    def start(self) -> None:
        """Begin to listen."""
        self._thread.start()

    def __call__(self, event: events.Event) -> None:
        """Note the station's state."""
        self.doubt(event)
        if isinstance(event, events.StateChanged):
            self._state = event.state

    def _on_enter(self) -> Command | None:
        if self._state is State.COMPLETE:
            return Repeat(back=self._back) if self._wrong else Accept(back=self._back)
        return _ON_ENTER.get(self._state)

    def _listen(self) -> None:
        for line in self._lines:
            word = line.strip()
            command = _command_of(word) if word else self._on_enter()
            if isinstance(command, Accept) and not command.reason and self._state is State.COMPLETE and self._wrong:
                echo("  something is wrong with it: `a WHY` accepts it for a reason, Enter repeats it", err=True)
            elif command is not None:
                self._send(command)
            elif word:
                echo(f"  `{word}` is no answer", err=True)
        # The input has ended: nobody will answer any more.
        self._send(Quit())


def _command_of(line: str) -> Command | None:
    word, _, rest = line.partition(" ")
    made = _WITH_TEXT.get(word.lower()) if rest.strip() else None
    return _WORDS.get(word[:1].lower()) if made is None else made(rest.strip())


def _temperature(text: str) -> AddNote | None:
    """Return the shop's temperature as a note, or None if implausible."""
    degc = shop_degc(text)
    return None if degc is None else AddNote(ambient_temp_c=degc)


_WITH_TEXT: dict[str, Callable[[str], Command | None]] = {"g": GoTo, "a": Accept, "n": AddNote, "t": _temperature}


def _lines(event: events.Event, centre: str) -> list[str]:
    match event:
        case events.RunAnnounced():
            head = f"{event.number} of {event.count}: test {event.run.test} {event.run.direction}"
            head += f" (repeat {event.run.repeat})" if event.run.repeat > 1 else ""
            return [head, *(f"  - {step}" for step in event.instructions)]
        case events.SessionFinished() if event.missing:
            return [f"left out, measure them another time: {', '.join(event.missing)}"]
        case events.SessionStopped() | events.Fault():
            run = event.interrupted
            return [] if run is None else [f"  {run.label}: interrupted, kept as far as it came"]
        case events.RunStarted(run=run):
            return _of(run, "recording")
        case events.RunCompleted(run=run):
            wrong = (f"{finding.name} wrong: {finding.text}" for finding in event.wrong)
            return _of(run, _word_of(event), _measured(event, centre), *wrong)
    told = message_of(event)
    return [] if told is None else [f"  {told.text}"]


def _of(run: events.RunId, *texts: str) -> list[str]:
    return [f"  {run.label}: {text}" for text in texts]


def _word_of(completed: events.RunCompleted) -> str:
    found = completed.answer
    if found.unseen:
        return f"{found.word}: {', '.join(found.unseen)}"
    return f"{found.word}: {found.causes[0]}" if found.causes and completed.figures is not None else str(found.word)


def _measured(completed: events.RunCompleted, centre: str) -> str:
    figures = completed.figures
    if figures is None:
        return completed.problem
    lost = f", {completed.lost} samples lost" if completed.lost else ""
    lost += f", {completed.doubtful} doubtful" if completed.doubtful else ""
    return (
        f"{completed.samples} samples{lost}; {centre} off {figures.centre_deviation_um:.1f} µm, "
        f"mean {figures.mean_radial_error_um:+.1f} µm, circularity {figures.circularity_um:.1f} µm"
    )
