"""Judge new runs by comparison with earlier runs and expected circles."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from dbbstation.errors import InputError, TraceError
from dbbstation.files.formats.session import RunEntry, RunState
from dbbstation.files.recordings.judged import circles_of_plan, run_of
from dbbstation.instrument.reading import DOUBTFUL
from dbbstation.quality.assigned import Assigned, FormerSitting, effects_of
from dbbstation.quality.finding import Finding, FindingVerdict, Name
from dbbstation.quality.judge import SessionRuns
from dbbstation.quality.knowledge import Others, coefficients_um, seen
from dbbstation.quality.single import by_itself
from dbbstation.quality.together import read_along_um
from dbbstation.station import events
from dbbstation.trace.analysis import figures
from dbbstation.trace.cut import cut

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.files.formats.session import CommandedProgram
    from dbbstation.files.recordings.session import SessionFolder
    from dbbstation.files.recordings.session_writer import SessionWriter
    from dbbstation.model.identified import IdentifiedModel
    from dbbstation.plan.plan import Direction
    from dbbstation.quality.knowledge import Planned, Seen
    from dbbstation.quality.plan_effects import PlanEffects
    from dbbstation.station.events import Event
    from dbbstation.trace.recording import Recording


@dataclass(frozen=True)
class JudgedRun:
    """A run's content and verdict."""

    completed: events.RunCompleted
    accepted: bool
    reason: str = ""


class RunJudge:
    """Judges each run together with the accepted runs; an observer of the station.

    Args:
        model: gives expected circles; None: the nominal machine.
        former: the last session of machine and plan; None: none.
    """

    def __init__(
        self,
        writer: SessionWriter,
        programs: Mapping[tuple[str, Direction], CommandedProgram] | None = None,
        model: IdentifiedModel | None = None,
        former: SessionFolder | None = None,
    ) -> None:
        self._writer = writer
        self._programs = programs or {}
        self._model = model
        self._planned = () if model is None else circles_of_plan(writer.session, model)
        self._counting: dict[tuple[str, Direction, int], Seen] = {}
        self._waiting: dict[tuple[str, Direction, int], Seen] = {}
        self._rejected: dict[tuple[str, Direction, int], Seen] = {}
        self._together = SessionRuns([])
        self._decided_before: Assigned | None = None
        self._former = former
        self._doubted: dict[events.RunId, Finding] = {}
        kept = {RunState.ACCEPTED: self._counting, RunState.REJECTED: self._rejected}
        for entry in writer.runs:
            if entry.state in kept:
                self._read(entry, kept[entry.state])

    def __call__(self, event: Event) -> None:
        """Note which runs are accepted."""
        if not isinstance(event, events.RunAccepted | events.RunRejected):
            return
        # Rejected runs are kept: a verdict may be taken back.
        accepted, key = isinstance(event, events.RunAccepted), _key(event.run)
        into, other = (self._counting, self._rejected) if accepted else (self._rejected, self._counting)
        for known in (self._waiting, other):
            if key in known:
                into[key] = known.pop(key)

    def known(self) -> tuple[JudgedRun, ...]:
        """Return figures and findings of judged runs from the disk."""
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

    def judge(self, run: events.RunId, recording: Recording) -> tuple[Finding, ...]:
        """Return a new run's findings."""
        entry = RunEntry(
            test=run.test,
            direction=run.direction,
            repeat=run.repeat,
            mounting=run.mounting,
            state=RunState.COMPLETE,
            started=next((known.started for known in self._writer.runs if _key(known) == _key(run)), None),
            path=self._writer.session.folder,
            program=self._programs.get((run.test, run.direction)),
        )
        one = run_of(self._writer.session, entry, recording, self._model, self._planned)
        self._waiting[_key(run)] = new = seen(one)
        counting = {key: known for key, known in self._counting.items() if key != _key(run)}
        # A circle during which something moved says nothing about the others.
        whole = new.analysis is not None and not any(finding.wrong for finding in by_itself(new, Others()))
        # Compensated programs make all circles alike, so a circle's form does not tell which one it is.
        assigned = self._assigned([*counting.values(), new]) if whole and entry.program is None else None
        suspects = {} if assigned is None else assigned.suspects()
        self._doubted = {events.RunId(*key, 0): suspects[known] for key, known in counting.items() if known in suspects}
        others = [known for known in counting.values() if known not in suspects]
        self._together = SessionRuns([*others, new], self._together)
        findings = self._together.judge(new).findings
        return findings if assigned is None else _decided(findings, new, assigned, suspects.get(new))

    def doubted(self) -> Mapping[events.RunId, Finding]:
        """Return accepted runs that contradict the others, as the last judged run shows."""
        return self._doubted

    def _assigned(self, runs: list[Seen]) -> Assigned | None:
        """Return the joint decision on all runs; None if the plan's circles are unknown."""
        known = {(one.test, one.circle.direction) for one in self._circles}
        if any((one.run.test, one.run.circle.direction) not in known for one in runs):
            return None
        self._decided_before = Assigned(self._effects, runs, self._former_sitting, self._decided_before)
        return self._decided_before

    @cached_property
    def _effects(self) -> tuple[PlanEffects, ...]:
        return effects_of(self._circles, self._former_sitting)

    @cached_property
    def _circles(self) -> tuple[Planned, ...]:
        return circles_of_plan(self._writer.session, self._model)

    @cached_property
    def _former_sitting(self) -> FormerSitting | None:
        former, read = self._former, {}
        if former is None:
            return None
        runs = [run for run in former.accepted if run.program is None]
        for entry in runs:
            with suppress(InputError, TraceError):
                form_um = coefficients_um(cut(former.load(entry).recording, circle := former.circle(entry)))
                read[entry.test, str(entry.direction)] = read_along_um(circle, form_um)
        dates = [run.started.date() for run in runs if run.started is not None]
        if not dates or any((one.test, str(one.circle.direction)) not in read for one in self._circles):
            return None
        return FormerSitting(former.folder.name, max(dates), read)

    def _read(self, entry: RunEntry, into: dict[tuple[str, Direction, int], Seen]) -> None:
        try:
            recording = self._writer.session.load(entry).recording
        except InputError:
            return
        one = run_of(self._writer.session, entry, recording, self._model, self._planned)
        into[_key(entry)] = seen(one)


def _decided(
    findings: tuple[Finding, ...], one: Seen, assigned: Assigned, suspect: Finding | None
) -> tuple[Finding, ...]:
    decided = []
    for finding in findings:
        if suspect is not None and finding.name is suspect.name:
            decided.append(suspect)
        elif suspect is None and finding.name in CIRCLE_SHOWN and finding.verdict is FindingVerdict.CANNOT_TELL:
            decided.append(assigned.finding(one, finding))
        else:
            decided.append(finding)
    since = assigned.since(one)
    return (*decided, since) if since is not None else tuple(decided)


CIRCLE_SHOWN = frozenset({Name.TEST, Name.DIRECTION})
"""Findings about which circle a run shows."""


def _key(run: events.RunId | RunEntry) -> tuple[str, Direction, int]:
    return run.test, run.direction, run.repeat
