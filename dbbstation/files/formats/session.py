"""`dbb-session/1`: the record of a session, one entry per run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer, ValidationInfo
from pydantic_core import PydanticKnownError

from dbbstation.facts.quantities import Ordinal, Point, Quantity, TemperatureDegc, Text, complaint, sound
from dbbstation.facts.record import LEFT_OUT_EMPTY, Moment, OrEmpty, Record, Sha256Hex, Sha256OrEmpty
from dbbstation.plan.bar import Bar
from dbbstation.plan.plan import Direction
from dbbstation.sources.contract import SetUpErrors

PART = ".part"


class RunState(StrEnum):
    """State of a run."""

    RECORDING = "recording"
    COMPLETE = "complete"
    ACCEPTED = "accepted"
    REJECTED = "rejected"


def _inside(path: str) -> str:
    parts = PurePosixPath(path).parts
    if not parts or PurePosixPath(path).is_absolute() or ".." in parts or "\\" in path:
        raise complaint(f"`{path}` must be a path inside the session folder, with forward slashes")
    return path


def _in_folder(path: object, info: ValidationInfo) -> Path:
    if not isinstance(path, str):
        raise PydanticKnownError("string_type")
    return sealed_or_part((info.context or Path()) / _inside(path))


def sealed_or_part(path: Path) -> Path:
    """Return a run's file, sealed or `.part`; it may have been sealed just before the program ended."""
    sealed = path.with_suffix("") if path.suffix == PART else path
    return sealed if not path.exists() and sealed.exists() else path


_NOT_READ = (None, None, None)

InsidePath = Annotated[str, AfterValidator(_inside)]
PathInFolder = Annotated[
    Path,
    BeforeValidator(_in_folder, json_schema_input_type=str),
    PlainSerializer(lambda path, info: path.relative_to(info.context).as_posix()),
    Field(alias="file"),
]
"""Path that a file names relative to the session folder, by the key `file`."""


@dataclass(frozen=True)
class ReadBy(Record):
    """The instrument that read the lengths, and whether it is real or virtual."""

    name: str
    """Name of the instrument or of its protocol file."""
    profile: OrEmpty = ""
    """Its variant; empty: the usual one."""
    port: OrEmpty = ""
    """Name or URL of the instrument's port."""
    virtual: bool = False
    """Whether machine and instrument are virtual, so that the readings describe no real machine."""

    @property
    def text(self) -> str:
        """Return the instrument in words: `heidenhain-nd281b at /dev/ttyUSB0`."""
        name = f"{self.name} ({self.profile})" if self.profile else self.name
        return f"{name} at {self.port}" if self.port else name


@dataclass(frozen=True)
class CommandedProgram(Record):
    """The commanded NC program, if it was not the plan's nominal circle."""

    path: PathInFolder
    """Path in the session folder."""
    sha256: Sha256Hex
    """SHA-256 of the program file."""
    model_sha256: Sha256OrEmpty = ""
    """SHA-256 of the model file that compensated it."""


@dataclass(frozen=True)
class Counts(Record):
    """Counts of received, lost and rejected samples of a run."""

    received: Annotated[int, Field(ge=0)]
    """Samples in the run file."""
    lost: Annotated[int, Field(ge=0)]
    """Samples that the line lost."""
    rejected: Mapping[str, Ordinal] = field(default_factory=dict)
    """Samples of the file that no calculation uses, by what the instrument said of them, such as `overrange`, and
    unreadable bytes by fault, such as `unreadable checksum`."""

    @property
    def text(self) -> str:
        """Return the counts in words: `1200 received, 3 lost, 2 rejected (overrange 2)`."""
        reasons = ", ".join(f"{reason} {count}" for reason, count in self.rejected.items())
        told = f"{self.received} received, {self.lost} lost, {sum(self.rejected.values())} rejected"
        return f"{told} ({reasons})" if reasons else told


@dataclass(frozen=True, kw_only=True)
class RunEntry(Record):
    """One run: one circle in one direction."""

    test: str
    """Test of the plan."""
    direction: Annotated[Direction, Field(strict=False)]
    """Sense of travel, seen from +Z."""
    repeat: Ordinal
    """Counts the runs of this test and direction, from 1."""
    mounting: Ordinal | None = None
    """Number of the ball's mounting; runs with the same number and ball share the ball's position. Absent: one mounting
    per test."""
    path: PathInFolder
    """Path in the session folder."""
    started: Moment | None = None
    """Time of the first sample."""
    state: Annotated[RunState, Field(strict=False)]
    """`recording`: the recording was interrupted; `complete`: not judged yet."""
    reason: OrEmpty = ""
    """Why it was rejected, or accepted without a circle."""
    sha256: Sha256OrEmpty = ""
    """SHA-256 of the run file; absent only while recording."""
    chain_sha256: Sha256OrEmpty = ""
    """Hash of this entry and the previous sealed run's `chain_sha256`."""
    counts: Counts | None = None
    """Samples received, rejected and lost; absent if another program recorded them."""
    centre_mm: Point | None = None
    """Centre of the programmed circle: x, y, z, machine frame, if rounding in the program changes the plan's centre
    [mm]."""
    instrument: ReadBy | None = None
    """Instrument of the run; absent in other programs' recordings."""
    program: CommandedProgram | None = None
    """The NC program, if not the plan's nominal circle."""

    @property
    def key(self) -> tuple[str, str, int]:
        """Return what tells the run from the others of its session."""
        return self.test, self.direction, self.repeat

    @property
    def name(self) -> str:
        """Return the name of the run's file without its ending."""
        return f"{self.test}-{self.direction}-{self.repeat}"

    @property
    def label(self) -> str:
        """Return the name of the run for messages."""
        return f"{self.test} {self.direction} {self.repeat}"


def starts_of(runs: Iterable[RunEntry]) -> list[Moment]:
    """Return the known starts of runs."""
    return [run.started for run in runs if run.started is not None]


def _unsealed(run: RunEntry) -> str:
    if run.state is RunState.RECORDING or run.sha256:
        return ""
    return f"the run is {run.state} but has no sha256; only a run that is being recorded may lack it"


_Reading = Annotated[float, Quantity("µm", 0, 5_000, signed=True)]
Readings: TypeAlias = tuple[_Reading | None, _Reading | None, _Reading | None]
"""x, y, z [µm]; None if not measured."""


@dataclass(frozen=True, kw_only=True)
class SetUpReadings(Record):
    """Micrometer readings of balls under the spindle, for one mounting."""

    test: str
    """A test of this mounting."""
    mounting: Ordinal | None = None
    """Number of the mounting in the runs; absent if they have none."""
    fixed_ball_um: Readings = _NOT_READ
    """Fixed ball minus tool tip with the machine at the ball's commanded position: x, y, z, machine frame; null if not
    measured [µm]."""
    moving_ball_um: Readings = _NOT_READ
    """Moving ball minus tool tip: x, y, z, platform frame; null if not measured [µm]."""
    uncertainty_um: Annotated[float, Quantity("µm", 0.01, 1_000)]
    """Standard uncertainty of each reading [µm]."""

    def to_domain(self) -> SetUpErrors:
        """Return the readings for calculations."""
        fixed_mm, moving_mm = (np.array(um, dtype=np.float64) / 1e3 for um in (self.fixed_ball_um, self.moving_ball_um))
        return SetUpErrors(fixed_mm, moving_mm, self.uncertainty_um / 1e3)


@dataclass(frozen=True)
class LogMark(Record):
    """Position in the session's event log when this file was written."""

    events: Ordinal
    """Number of its events."""
    sha256: Sha256Hex
    """Link of the last event."""


@dataclass(frozen=True)
class Seal(Record):
    """Hashes of machine, plan and jig when the session was sealed, and the number of runs."""

    files: Mapping[str, Sha256Hex]
    """SHA-256 of machine, plan and the plan's jig file, by their paths in this file."""
    runs: Annotated[int, Field(ge=0)]
    """Number of sealed runs."""
    chain_sha256: Sha256OrEmpty = ""
    """`chain_sha256` of the last sealed run; absent if there is none."""
    log: LogMark | None = None
    """The event log of this file; every valid seal names one."""


@dataclass(frozen=True)
class Amendment(Record):
    """A deliberate change of a sealed file."""

    what: str
    """Changed file, named as in `seal.files`; `runs` for the list of runs."""
    former_sha256: Annotated[Sha256OrEmpty, Field(default="")]
    """Hash of the former file, or `chain_sha256` of the former list's last run; absent if there was none."""
    sha256: Annotated[Sha256OrEmpty, Field(default="")]
    """The same hash now."""
    former: Annotated[OrEmpty, AfterValidator(lambda path: path and _inside(path)), Field(default="")]
    """Path of the former file in the session folder."""
    reason: Text
    """Reason, as the user stated it."""
    made: Moment
    """Date and time."""

    @property
    def text(self) -> str:
        """Return the change in words."""
        kept = f"; as it was: {self.former}" if self.former else ""
        return f"{self.what} was changed on purpose, {self.made:%Y-%m-%d %H:%M %Z}: {self.reason}{kept}"


@dataclass(frozen=True)
class Note(Record):
    """A note during the measurement."""

    made: Moment
    """Date and time."""
    text: OrEmpty = ""
    """Text of the note."""
    ambient_temp_c: TemperatureDegc | None = None
    """Temperature of the shop at this time [degC]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SessionDetails(Record):
    """Facts that a session notes in addition to its runs."""

    serial_number: str = ""
    """Serial number of the machine."""
    operator: str = ""
    """Name of the operator."""
    job: OrEmpty = ""
    """Job or order number of the measurement."""
    ambient_temp_c: TemperatureDegc | None = None
    """Temperature of the shop [degC]."""
    instrument: ReadBy | None = None
    """Instrument at the session's start; its runs are all virtual or all real."""
    bar: Bar | None = None
    """The bar."""
    bar_waiver: OrEmpty = ""
    """Reason for measuring without a fresh calibration of the bar."""
    seal: Seal | None = None
    """The seal; absent in sessions that were written by hand."""
    amendments: Annotated[tuple[Amendment, ...], LEFT_OUT_EMPTY] = ()
    """Deliberate changes of sealed files, oldest first."""
    notes: Annotated[tuple[Note, ...], LEFT_OUT_EMPTY] = ()
    """Notes during the measurement, oldest first."""
    set_up_errors: Annotated[tuple[SetUpReadings, ...], LEFT_OUT_EMPTY] = ()
    """Micrometer readings of balls that were put up under the spindle, one entry per mounting."""

    @property
    def noted(self) -> bool:
        """Return whether anything is noted."""
        return any(getattr(self, each.name) != each.default for each in fields(SessionDetails))


@dataclass(frozen=True, kw_only=True, eq=False)
class SessionFile(SessionDetails):
    """Record of a session: paths of machine and plan, the bar, one entry per run."""

    format: Literal["dbb-session/1"]
    """Name and version of this format."""
    machine: InsidePath
    """The controller's nominal machine during the measurement, `dbb-machine/1`."""
    plan: InsidePath
    """The test plan as run, `dbb-plan/1`."""
    runs: tuple[Annotated[RunEntry, sound(_unsealed)], ...] = ()
    """Runs in the order they were started."""
