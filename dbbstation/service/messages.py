"""Messages of events and their importance."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from dbbstation.station import events


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
