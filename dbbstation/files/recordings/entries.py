"""A session's entries of runs, bar and programs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.files.recordings.run_csv import sealed_or_part
from dbbstation.plan.bar import Bar
from dbbstation.plan.circle import Direction

if TYPE_CHECKING:
    from pathlib import Path

    from dbbstation.files.formats.session import BarSchema, InstrumentSchema, NoteSchema, ProgramSchema, RunSchema


class RunState(StrEnum):
    """State of a run."""

    RECORDING = "recording"
    COMPLETE = "complete"
    ACCEPTED = "accepted"
    REJECTED = "rejected"


@dataclass(frozen=True)
class CommandedProgram:
    """The NC program of a run.

    Attributes:
        model_sha256: model of its compensation; empty if none.
    """

    path: Path
    sha256: str
    model_sha256: str


@dataclass(frozen=True)
class ReadBy:
    """The instrument of a session or a run.

    Attributes:
        name: of the instrument or its protocol file.
        profile: empty: the usual one.
        port: name or URL; empty if there is none.
    """

    name: str
    profile: str = ""
    port: str = ""
    virtual: bool = False

    @property
    def text(self) -> str:
        """Return the instrument in words: `heidenhain-nd281b at /dev/ttyUSB0`."""
        name = f"{self.name} ({self.profile})" if self.profile else self.name
        return f"{name} at {self.port}" if self.port else name


def read_by(instrument: InstrumentSchema | None) -> ReadBy | None:
    """Return a file's instrument in the program's form."""
    return None if instrument is None else ReadBy(**instrument.model_dump())


@dataclass(frozen=True)
class Counts:
    """Counts of samples during a run.

    Attributes:
        rejected: unused samples by the instrument's status, and unreadable bytes by fault (`unreadable checksum`).
    """

    received: int
    lost: int
    rejected: Mapping[str, int]

    @property
    def text(self) -> str:
        """Return the counts in words: `1200 received, 3 lost, 2 rejected (overrange 2)`."""
        reasons = ", ".join(f"{reason} {count}" for reason, count in self.rejected.items())
        told = f"{self.received} received, {self.lost} lost, {sum(self.rejected.values())} rejected"
        return f"{told} ({reasons})" if reasons else told

    def data(self) -> dict[str, object]:
        """Return the counts as plain values."""
        return {"received": self.received, "lost": self.lost, "rejected": dict(self.rejected)}


@dataclass(frozen=True)
class Note:
    """A note by the operator.

    Attributes:
        text: empty for a temperature alone.
        ambient_temp_c: of the shop; None if not read.
    """

    made: datetime
    text: str = ""
    ambient_temp_c: float | None = None


def note_entry(note: NoteSchema) -> Note:
    """Return a file's note in the program's form."""
    return Note(datetime.fromisoformat(note.made), note.text, note.ambient_temp_c)


@dataclass(frozen=True)
class RunEntry:
    """A session's entry of one run.

    Attributes:
        repeat: from 1.
        mounting: number of the ball's set-up; None: one per test.
        reason: of a rejection, or of accepting a run without a circle; else empty.
        started: first sample; None if not noted.
        sha256: of its file; empty while recording.
        program: None: the plan's circle.
        centre_mm: as programmed, machine frame (x, y, z); None: as planned.
        chain_sha256: link in the chain of sealed runs, or empty.
        counts: None if not noted.
    """

    test: str
    direction: Direction
    repeat: int
    mounting: int | None
    state: RunState
    reason: str
    started: datetime | None
    path: Path
    sha256: str
    program: CommandedProgram | None
    centre_mm: tuple[float, float, float] | None
    chain_sha256: str = ""
    counts: Counts | None = None
    instrument: ReadBy | None = None

    @property
    def label(self) -> str:
        """Return the name of the run for messages."""
        return f"{self.test} {self.direction} {self.repeat}"


def run_entry(run: RunSchema, folder: Path) -> RunEntry:
    """Return a file's entry of a run in the program's form."""
    return RunEntry(
        test=run.test,
        direction=Direction(run.direction),
        repeat=run.repeat,
        mounting=run.mounting,
        state=RunState(run.state),
        reason=run.reason or "",
        started=None if run.started is None else datetime.fromisoformat(run.started),
        path=sealed_or_part(folder / run.file),
        sha256=run.sha256 or "",
        program=None if run.program is None else _program(run.program, folder),
        centre_mm=run.centre_mm,
        chain_sha256=run.chain_sha256 or "",
        counts=None if run.counts is None else Counts(**run.counts.model_dump()),
        instrument=read_by(run.instrument),
    )


def _program(program: ProgramSchema, folder: Path) -> CommandedProgram:
    return CommandedProgram(folder / program.file, program.sha256, program.model_sha256 or "")


def counts_in(header: Mapping[str, str]) -> Counts | None:
    """Return the counts in a run file's `# key: value` lines, or None."""
    received, lost = count_in(header.get("received", "")), count_in(header.get("lost", ""))
    if received is None or lost is None:
        return None
    prefix = "rejected "
    said = {key.removeprefix(prefix): count_in(value) for key, value in header.items() if key.startswith(prefix)}
    return Counts(received, lost, {reason: count for reason, count in said.items() if count})


def count_in(text: str) -> int | None:
    """Return the non-negative integer of a text, or None."""
    return int(text) if re.fullmatch(r"[0-9]{1,12}", text) else None


def bar_entry(bar: BarSchema) -> Bar:
    """Return a session file's bar in the program's form."""
    moment = None if bar.calibrated is None else datetime.fromisoformat(bar.calibrated)
    return Bar(**{**bar.model_dump(), "calibrated": moment})
