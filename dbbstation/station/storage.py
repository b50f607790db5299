"""Storage writes every sample and verdict into the session folder."""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import OutputError
from dbbstation.files.formats.session import Counts, Note
from dbbstation.station import events
from dbbstation.station.run_record import recording_of
from dbbstation.trace.columns import STATUS_GOOD, TIME_UNCERTAINTY
from dbbstation.trace.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from dbbstation.files.formats.session import CommandedProgram, ReadBy, RunEntry
    from dbbstation.files.recordings.journal import RunWriter
    from dbbstation.files.recordings.session_writer import SessionWriter
    from dbbstation.plan.plan import Direction

COLUMNS = ("t_s", "length_mm", "status")
"""Columns that the station records for every instrument."""


FASTER_BEGINS_BEFORE = timedelta(days=30)
"""Time by which a faster clock begins in the past: at ten times real time it reaches the computer's time after three
days of measuring."""


class Storage:
    """Writes a session as it happens; an observer of the station.

    Args:
        asked: whether each reading is requested, so that its time has an own uncertainty.
    """

    def __init__(
        self,
        writer: SessionWriter,
        now: Callable[[], datetime] | None = None,
        programs: Mapping[tuple[str, Direction], CommandedProgram] | None = None,
        unreadable: Callable[[], Mapping[str, int]] = dict,
        *,
        asked: bool = False,
        instrument: ReadBy | None = None,
    ) -> None:
        self._writer = writer
        self._now = now or (lambda: datetime.now(UTC))
        self._programs = programs or {}
        self._journal: RunWriter | None = None
        self._received = self._lost = 0
        self._rejected: Counter[str] = Counter()
        self._unreadable = unreadable
        self._columns = (*COLUMNS, TIME_UNCERTAINTY) if asked else COLUMNS
        self._unreadable_before: Counter[str] = Counter()
        self._instrument = instrument

    def __call__(self, event: events.Event) -> None:
        """Write an event into the session.

        Raises:
            OutputError: the disk refuses; earlier data stays.
        """
        match event:
            case events.RunStarted():
                self._start(event.run)
            case events.SamplesRecorded():
                self._append(event.samples)
            case events.RunCompleted() if self._journal is not None:
                garbled = Counter(self._unreadable()) - self._unreadable_before
                rejected = self._rejected + Counter({f"unreadable {why}": count for why, count in garbled.items()})
                counts = Counts(self._received, self._lost, dict(sorted(rejected.items())))
                self._writer.finish_run(self._journal, counts)
                self._journal = None
            case events.RunAccepted():
                self._writer.judge(self._entry(event.run), accepted=True, reason=event.reason)
            case events.RunRejected():
                self._writer.judge(self._entry(event.run), accepted=False, reason=event.reason)
            case events.Noted():
                self._writer.note(Note(self._now(), event.text, event.ambient_temp_c))
            case events.SessionStopped() | events.Fault():
                self.close()
            case _:
                pass

    def recorded(self, run: events.RunId, behind: Sequence[events.Sample]) -> Recording:
        """Return the current run from its journal.

        Raises:
            InputError: the journal cannot be read, or was altered.
        """
        last = recording_of(run, behind)
        if self._journal is None or not self._journal.samples:
            return last
        first = self._journal.read().recording
        kept = np.ones(len(first), dtype=np.bool_) if first.usable is None else first.usable
        return Recording(
            name=run.label,
            t_s=np.concatenate([first.t_s, last.t_s]),
            length_mm=np.concatenate([first.length_mm, last.length_mm]),
            usable=np.concatenate([kept, last.usable]),
        )

    def sync_if_due(self) -> None:
        """Write all data to the disk once it has waited for a second, even without new readings.

        Raises:
            OutputError: the disk refuses.
        """
        if self._journal is not None:
            self._journal.sync_if_due()

    def close(self) -> None:
        """Write the current run to the disk; its file remains a `.part`."""
        if self._journal is None:
            return
        journal, self._journal = self._journal, None
        try:
            journal.sync()
        finally:
            journal.close()

    def _start(self, run: events.RunId) -> None:
        self._received = self._lost = 0
        self._rejected.clear()
        self._unreadable_before = Counter(self._unreadable())
        self._journal = self._writer.start_run(
            run.test,
            run.direction,
            self._columns,
            started=self._now(),
            mounting=run.mounting,
            program=self._programs.get((run.test, run.direction)),
            instrument=self._instrument,
        )
        expected = self._writer.session.folder / "runs" / f"{run.label}.csv"
        if self._journal.sealed_path != expected:
            raise OutputError(
                f"the run needs the name {expected.name}, which is taken",
                where=str(expected.parent),
                remedy="another program writes into this session: end it, then continue",
            )

    def _entry(self, run: events.RunId) -> RunEntry:
        return next(entry for entry in self._writer.runs if entry.key == run.key)

    def _append(self, samples: tuple[events.Sample, ...]) -> None:
        if self._journal is None:
            raise RuntimeError("samples came without a run")
        for sample in samples:
            if sample.length_mm is None:
                raise RuntimeError("a recorded sample has a number")
            values = (sample.t_s, sample.length_mm, sample.status)
            self._journal.append(
                values if len(self._columns) == len(values) else (*values, sample.t_uncertainty_s or 0.0)
            )
            self._received += 1
            self._lost += sample.lost
            if sample.status != STATUS_GOOD:
                self._rejected[sample.status] += 1


def time_of_day(clock: Callable[[], float], last: datetime | None = None) -> Callable[[], datetime]:
    """Return a clock of the time of day that runs as fast as a scaled `clock`.

    It begins far enough in the past to stay behind the computer's time.
    """
    begun_s = clock()
    begun = datetime.now(UTC) - FASTER_BEGINS_BEFORE
    begun = begun if last is None else max(begun, last)
    return lambda: begun + timedelta(seconds=clock() - begun_s)
