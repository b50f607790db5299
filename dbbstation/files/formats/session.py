"""`dbb-session/1`: the record of a session, one entry per run."""

from datetime import date, datetime
from pathlib import PurePosixPath
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from dbbstation.files.formats.quantities import ExpansionUmMK, Point, Quantity, TemperatureDegc
from dbbstation.files.yaml.schema import Schema


def _inside(path: str) -> str:
    parts = PurePosixPath(path).parts
    if not parts or PurePosixPath(path).is_absolute() or ".." in parts or "\\" in path:
        raise PydanticCustomError(
            "outside", "`{path}` must be a path inside the session folder, with forward slashes", {"path": path}
        )
    return path


def _moment(text: str) -> str:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise PydanticCustomError(
            "moment", "`{text}` is not a time with its zone, such as 2026-11-20T08:04:11Z", {"text": text}
        )
    return text


def _day(text: str) -> str:
    try:
        date.fromisoformat(text)
    except ValueError:
        raise PydanticCustomError("day", "`{text}` is not a date", {"text": text}) from None
    return text


_NOT_READ = (None, None, None)

BAR_LENGTH = Quantity("mm", 20, 2_000)
"""Plausible lengths of ball bars."""

InsidePath = Annotated[str, AfterValidator(_inside)]
Day = Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$"), AfterValidator(_day)]
Moment = Annotated[str, AfterValidator(_moment), Field(json_schema_extra={"format": "date-time"})]
Sha256Hex = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class BarSchema(Schema):
    """The bar and the calibration of its length, which is compared with the plan and never added to readings."""

    serial_number: str = ""
    """Serial number of the bar."""
    calibrated_length_mm: Annotated[float, BAR_LENGTH]
    """Calibrated distance between the ball centres [mm]."""
    calibrator_uncertainty_mm: Annotated[float, Quantity("mm", 1e-6, 0.1, or_zero=True)]
    """Standard uncertainty of this length [mm]."""
    stroke_mm: Annotated[float, Quantity("mm", 0.1, 100)] | None = None
    """Travel of its gauge from this length, either way; circles of other radii are impossible [mm]."""
    calibrated: Moment | None = None
    """When."""
    temp_c: TemperatureDegc | None = None
    """Temperature of the bar at its calibration [degC]."""
    expansion_um_m_k: ExpansionUmMK | None = None
    """Thermal expansion of the bar [µm/(m K)]."""
    reading_mm: Annotated[float, BAR_LENGTH] | None = None
    """Reading on the calibrator. The fit accounts for the difference; recorded lengths are never corrected [mm]."""
    temp_uncertainty_k: Annotated[float, Quantity("K", 0.001, 10)] | None = None
    """Standard uncertainty of a temperature of the bar; if stated, the fit accounts for the bar's growth [K]."""
    calibrator_serial_number: str | None = None
    """Of the calibrator."""
    calibrator_certificate: str | None = None
    """Number and issuer of its certificate."""
    calibrator_certified: Day | None = None
    """Date of its certificate."""
    calibrator_valid_until: Day | None = None
    """Last day on which the certificate is valid."""
    ball_form_um: Annotated[float, Quantity("µm", 0.001, 100, or_zero=True)] | None = None
    """Largest deviation of the bar's ball from a sphere by its certificate [µm]."""


class InstrumentSchema(Schema):
    """The instrument that read the lengths, and whether it is real or virtual."""

    name: str
    """Name of the instrument or of its protocol file."""
    profile: str = ""
    """Its variant; empty: the usual one."""
    port: str = ""
    """Name or URL of the instrument's port."""
    virtual: bool
    """Whether machine and instrument are virtual, so that the readings describe no real machine."""


class ProgramSchema(Schema):
    """The commanded NC program, if it was not the plan's nominal circle."""

    file: InsidePath
    """Path in the session folder."""
    sha256: Sha256Hex
    """Of the program file."""
    model_sha256: Sha256Hex | None = None
    """Of the model file that it was compensated with."""


class CountsSchema(Schema):
    """Counts of received, lost and rejected samples of a run."""

    received: Annotated[int, Field(ge=0)]
    """Samples in the run file."""
    lost: Annotated[int, Field(ge=0)]
    """Samples that the line lost."""
    rejected: dict[str, Annotated[int, Field(ge=1)]] = Field(default={})
    """Samples of the file that no calculation uses, by the instrument's status, such as `overrange`."""


class RunSchema(Schema):
    """One run: one circle in one direction."""

    test: str
    """Test of the plan."""
    direction: Literal["ccw", "cw"]
    """Sense of travel, seen from +Z."""
    repeat: Annotated[int, Field(ge=1)]
    """Counts the runs of this test and direction, from 1."""
    mounting: Annotated[int, Field(ge=1)] | None = None
    """Number of the ball's mounting; runs with the same number and ball share the ball's position. Absent: one mounting
    per test."""
    file: InsidePath
    """Path in the session folder."""
    started: Moment | None = None
    """Time of the first sample."""
    state: Literal["recording", "complete", "accepted", "rejected"]
    """`recording`: the recording was interrupted; `complete`: not judged yet."""
    reason: str | None = None
    """Reason for a rejection."""
    sha256: Sha256Hex | None = None
    """Of the run file; absent only while recording."""
    chain_sha256: Sha256Hex | None = None
    """Hash of this entry and the previous sealed run's `chain_sha256`."""
    counts: CountsSchema | None = None
    """Samples received, rejected and lost; absent if another program recorded them."""
    instrument: InstrumentSchema | None = None
    """Instrument of the run; absent in other programs' recordings."""
    program: ProgramSchema | None = None
    """The NC program, if not the plan's nominal circle."""
    centre_mm: Point | None = None
    """Centre of the programmed circle: x, y, z, machine frame, if rounding in the program changes the plan's centre
    [mm]."""

    @model_validator(mode="after")
    def _sealed(self) -> Self:
        if self.state != "recording" and self.sha256 is None:
            raise PydanticCustomError(
                "unsealed",
                "the run is {state} but has no sha256; only a run in recording has none",
                {"state": self.state},
            )
        return self


_Reading = Annotated[float, Quantity("µm", 0, 5_000, signed=True)]


class SetUpErrorsSchema(Schema):
    """Micrometer readings of balls under the spindle, for one mounting."""

    test: str
    """A test of this mounting."""
    mounting: Annotated[int, Field(ge=1)] | None = None
    """Number of the mounting in the runs; absent if they have none."""
    fixed_ball_um: tuple[_Reading | None, _Reading | None, _Reading | None] = _NOT_READ
    """Fixed ball minus tool tip with the machine at the ball's commanded position: x, y, z, machine frame; null if not
    measured [µm]."""
    moving_ball_um: tuple[_Reading | None, _Reading | None, _Reading | None] = _NOT_READ
    """Moving ball minus tool tip: x, y, z, platform frame; null if not measured [µm]."""
    uncertainty_um: Annotated[float, Quantity("µm", 0.01, 1_000)]
    """Standard uncertainty of each reading [µm]."""


class LogSchema(Schema):
    """Position in the session's event log when this file was written."""

    events: Annotated[int, Field(ge=1)]
    """Number of its events."""
    sha256: Sha256Hex
    """Link of the last event."""


class SealSchema(Schema):
    """Hashes of machine, plan and jig when the session was sealed, and the number of runs."""

    files: dict[str, Sha256Hex]
    """SHA-256 of machine, plan and the plan's jig file, by their paths in this file."""
    runs: Annotated[int, Field(ge=0)]
    """Number of sealed runs."""
    chain_sha256: Sha256Hex | None = None
    """`chain_sha256` of the last sealed run; absent if there is none."""
    log: LogSchema | None = None
    """The event log of this file; every valid seal names one."""


class AmendmentSchema(Schema):
    """A deliberate change of a sealed file."""

    what: str
    """Changed file, named as in `seal.files`; `runs` for the list of runs."""
    former_sha256: Sha256Hex | None = None
    """Hash of the former file, or `chain_sha256` of the former list's last run; absent if there was none."""
    sha256: Sha256Hex | None = None
    """The same now."""
    former: InsidePath | None = None
    """Path of the former file in the session folder."""
    reason: Annotated[str, Field(min_length=1)]
    """Reason, as the user stated it."""
    made: Moment
    """When."""


class NoteSchema(Schema):
    """A note during the measurement."""

    made: Moment
    """When."""
    text: str = ""
    """In their words."""
    ambient_temp_c: TemperatureDegc | None = None
    """Temperature of the shop at this time [degC]."""


class SessionFile(Schema):
    """Record of a session: paths of machine and plan, the bar, one entry per run."""

    format: Literal["dbb-session/1"]
    """Name and version of this format."""
    machine: InsidePath
    """The controller's nominal machine during the measurement, `dbb-machine/1`."""
    plan: InsidePath
    """The test plan as run, `dbb-plan/1`."""
    serial_number: str = ""
    """Of the machine."""
    operator: str = ""
    """Name of the operator."""
    job: str = ""
    """Job or order number of the measurement."""
    ambient_temp_c: TemperatureDegc | None = None
    """Temperature of the shop [degC]."""
    instrument: InstrumentSchema | None = None
    """Instrument at the session's start; its runs are all virtual or all real."""
    bar: BarSchema | None = None
    """The bar."""
    bar_waiver: str = ""
    """Reason for measuring without a fresh calibration of the bar."""
    seal: SealSchema | None = None
    """The seal; absent in sessions that were written by hand."""
    amendments: tuple[AmendmentSchema, ...] = ()
    """Deliberate changes of sealed files, oldest first."""
    notes: tuple[NoteSchema, ...] = ()
    """Notes during the measurement, oldest first."""
    set_up_errors: tuple[SetUpErrorsSchema, ...] = ()
    """Micrometer readings of balls that were put up under the spindle, one entry per mounting."""
    runs: tuple[RunSchema, ...] = ()
    """Runs in the order they were started."""
