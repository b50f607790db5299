"""Judge new runs against earlier ones and expectation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.errors import InputError
from dbbstation.files.recordings.entries import RunEntry, RunState
from dbbstation.files.recordings.judged import planned_circles, run_of
from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import seen
from dbbstation.station import events
from dbbstation.trace.analysis import figures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.files.recordings.entries import CommandedProgram
    from dbbstation.files.recordings.session_writer import SessionWriter
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.circle import Direction
    from dbbstation.quality.finding import Finding
    from dbbstation.quality.knowledge import Seen
    from dbbstation.station.events import Event, RunId
    from dbbstation.trace.recording import Recording


@dataclass(frozen=True)
class JudgedRun:
    """A run's content and verdict.

    Attributes:
        completed: figures and findings.
        reason: of a rejection; may be empty.
    """

    completed: events.RunCompleted
    accepted: bool
    reason: str = ""


class RunJudge:
    """Judges runs beside counted ones; an observer of the station.

    Args:
        writer: its judged runs are read now.
        programs: by test and direction.
        model: gives expected circles; None: the nominal machine.
    """

    def __init__(
        self,
        writer: SessionWriter,
        programs: Mapping[tuple[str, Direction], CommandedProgram] | None = None,
        model: IdentifiedModel | None = None,
    ) -> None:
        self._writer = writer
        self._programs = programs or {}
        self._model = model
        self._planned = planned_circles(writer.session, model)
        self._counting: dict[tuple[str, Direction, int], Seen] = {}
        self._waiting: dict[tuple[str, Direction, int], Seen] = {}
        self._rejected: dict[tuple[str, Direction, int], Seen] = {}
        self._together = SessionRuns([])
        kept = {RunState.ACCEPTED: self._counting, RunState.REJECTED: self._rejected}
        for entry in writer.runs:
            if entry.state in kept:
                self._read(entry, kept[entry.state])

    def __call__(self, event: Event) -> None:
        """Note which runs count."""
        if not isinstance(event, events.RunAccepted | events.RunRejected):
            return
        key = _key(event.run)
        if isinstance(event, events.RunAccepted):
            for known in (self._waiting, self._rejected):
                if key in known:
                    self._counting[key] = known.pop(key)
        else:
            for known in (self._counting, self._waiting):
                if key in known:
                    # Kept: a verdict may be taken back.
                    self._rejected[key] = known.pop(key)

    def known(self) -> tuple[JudgedRun, ...]:
        """Return figures and findings of judged runs from disk."""
        together = SessionRuns(list(self._counting.values()), self._together)
        found = []
        for entry in self._writer.runs:
            one = self._counting.get(_key(entry)) or self._rejected.get(_key(entry))
            if one is None:
                continue
            shown = None if one.analysis is None else figures(one.analysis.raw)
            run = events.RunId(*_key(entry), entry.mounting or 0)
            findings = () if shown is None else together.judge(one).findings
            doubtful = 0 if entry.counts is None else entry.counts.rejected.get(DOUBTFUL, 0)
            samples = len(one.run.recording)
            completed = events.RunCompleted(run, samples, one.lost[0], shown, one.problem, findings, doubtful)
            found.append(JudgedRun(completed, entry.state is RunState.ACCEPTED, entry.reason))
        return tuple(found)

    def judge(self, run: RunId, recording: Recording) -> tuple[Finding, ...]:
        """Return a new run's findings.

        Args:
            run: storage may not know it yet.
        """
        entry = RunEntry(
            test=run.test,
            direction=run.direction,
            repeat=run.repeat,
            mounting=run.mounting,
            state=RunState.COMPLETE,
            reason="",
            started=next((known.started for known in self._writer.runs if _key(known) == _key(run)), None),
            path=self._writer.session.folder,
            sha256="",
            program=self._programs.get((run.test, run.direction)),
            centre_mm=None,
        )
        one = run_of(self._writer.session, entry, recording, self._model, self._planned)
        self._waiting[_key(run)] = new = seen(one)
        others = [known for key, known in self._counting.items() if key != _key(run)]
        self._together = SessionRuns([*others, new], self._together)
        return self._together.judge(new).findings

    def _read(self, entry: RunEntry, into: dict[tuple[str, Direction, int], Seen]) -> None:
        """Take in a recorded run; unreadable ones are reported elsewhere."""
        try:
            recording = self._writer.session.load(entry).recording
        except InputError:
            return
        one = run_of(self._writer.session, entry, recording, self._model, self._planned)
        into[_key(entry)] = seen(one)


def _key(run: RunId | RunEntry) -> tuple[str, Direction, int]:
    return run.test, run.direction, run.repeat
