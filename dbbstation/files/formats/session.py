"""`dbb-session/1`: what was done in a session, one entry per run."""

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
"""Lengths that ball bars have."""

InsidePath = Annotated[str, AfterValidator(_inside)]
Day = Annotated[str, Field(pattern=r"^\d{4}-\d{2}-\d{2}$"), AfterValidator(_day)]
Moment = Annotated[str, AfterValidator(_moment), Field(json_schema_extra={"format": "date-time"})]
Sha256Hex = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class BarSchema(Schema):
    """The bar and the calibration of its length, which is compared with the plan and never added to readings."""

    serial_number: str = ""
    """Of the bar."""
    calibrated_length_mm: Annotated[float, BAR_LENGTH]
    """Distance between the ball centres that the calibration found [mm]."""
    calibrator_uncertainty_mm: Annotated[float, Quantity("mm", 1e-6, 0.1, or_zero=True)]
    """Uncertainty of that length, one standard deviation [mm]."""
    stroke_mm: Annotated[float, Quantity("mm", 0.1, 100)] | None = None
    """How far its gauge travels from that length, either way; circles of other radii cannot have been run with it [mm]."""
    calibrated: Moment | None = None
    """When."""
    temp_c: TemperatureDegc | None = None
    """Temperature of the bar then [degC]."""
    expansion_um_m_k: ExpansionUmMK | None = None
    """Thermal expansion of the bar [µm/(m K)]."""
    reading_mm: Annotated[float, BAR_LENGTH] | None = None
    """What it read on its calibrator; the fit knows the difference, recorded lengths stay as read [mm]."""
    temp_uncertainty_k: Annotated[float, Quantity("K", 0.001, 10)] | None = None
    """Standard uncertainty of a temperature of the bar; where it is stated, the fit knows what the bar grew by [K]."""
    calibrator_serial_number: str | None = None
    """Of the calibrator."""
    calibrator_certificate: str | None = None
    """Number of its certificate and who issued it."""
    calibrator_certified: Day | None = None
    """Date of its certificate."""
    calibrator_valid_until: Day | None = None
    """Last day on which it holds."""
    ball_form_um: Annotated[float, Quantity("µm", 0.001, 100, or_zero=True)] | None = None
    """Largest deviation of the bar's ball from a sphere by its certificate [µm]."""


class InstrumentSchema(Schema):
    """The instrument that read the lengths, and whether it is real or virtual."""

    name: str
    """Name of the instrument or of its protocol file."""
    profile: str = ""
    """Its variant; empty: the usual one."""
    port: str = ""
    """Name or URL of the port that it was read at."""
    virtual: bool
    """Whether machine and instrument are virtual: what was read says nothing of a real machine."""


class ProgramSchema(Schema):
    """The commanded NC program, if it was not the plan's nominal circle."""

    file: InsidePath
    """Path in the session folder."""
    sha256: Sha256Hex
    """Of the program file."""
    model_sha256: Sha256Hex | None = None
    """Of the model file that it was compensated with."""


class CountsSchema(Schema):
    """What came over the line during a run, and what did not."""

    received: Annotated[int, Field(ge=0)]
    """Samples in the run file."""
    lost: Annotated[int, Field(ge=0)]
    """Samples that the line lost between them."""
    rejected: dict[str, Annotated[int, Field(ge=1)]] = Field(default={})
    """Samples of the file that no calculation uses, by what the instrument said of them, such as `overrange`."""


class RunSchema(Schema):
    """One run: one circle in one direction."""

    test: str
    """Test of the plan."""
    direction: Literal["ccw", "cw"]
    """Sense of travel, seen from +Z."""
    repeat: Annotated[int, Field(ge=1)]
    """Counts the runs of this test and direction, from 1."""
    mounting: Annotated[int, Field(ge=1)] | None = None
    """Counts how often a ball was put up; runs with one number at one ball share the ball's place. Absent: one
    mounting per test."""
    file: InsidePath
    """Path in the session folder."""
    started: Moment | None = None
    """When the first sample was taken."""
    state: Literal["recording", "complete", "accepted", "rejected"]
    """`recording`: the station died here; `complete`: not judged yet."""
    reason: str | None = None
    """Why it was rejected."""
    sha256: Sha256Hex | None = None
    """Of the run file; absent only while recording."""
    chain_sha256: Sha256Hex | None = None
    """Covers this entry and the `chain_sha256` of the sealed run before it in the list."""
    counts: CountsSchema | None = None
    """Samples received, rejected and lost; absent where the recording was made elsewhere."""
    instrument: InstrumentSchema | None = None
    """What read it; absent in recordings made elsewhere."""
    program: ProgramSchema | None = None
    """What was commanded, where that was not the plan's nominal circle."""
    centre_mm: Point | None = None
    """Centre of the circle as programmed: x, y, z, machine frame, where rounding in the program makes it differ from
    the plan [mm]."""

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
    """What a micrometer read of balls that were put up under the spindle, for one mounting."""

    test: str
    """A test that was run on the mounting."""
    mounting: Annotated[int, Field(ge=1)] | None = None
    """Number of the mounting as the runs have it; absent where they have none."""
    fixed_ball_um: tuple[_Reading | None, _Reading | None, _Reading | None] = _NOT_READ
    """Fixed ball less tool tip while the machine stands at the ball's commanded place: x, y, z, machine frame; null where
    nobody measured [µm]."""
    moving_ball_um: tuple[_Reading | None, _Reading | None, _Reading | None] = _NOT_READ
    """Moving ball less tool tip: x, y, z, platform frame; null where nobody measured [µm]."""
    uncertainty_um: Annotated[float, Quantity("µm", 0.01, 1_000)]
    """Of each reading, one standard deviation [µm]."""


class LogSchema(Schema):
    """How far the event log of the session went when this file was written."""

    events: Annotated[int, Field(ge=1)]
    """Number of its events."""
    sha256: Sha256Hex
    """Link of the last of them."""


class SealSchema(Schema):
    """Hashes of the files beside the runs when the session was sealed, and the number of runs."""

    files: dict[str, Sha256Hex]
    """SHA-256 of machine, plan and the jig file that the plan may name, by their paths as this file names them."""
    runs: Annotated[int, Field(ge=0)]
    """Number of sealed runs."""
    chain_sha256: Sha256Hex | None = None
    """`chain_sha256` of the last of them; absent where there is none."""
    log: LogSchema | None = None
    """The event log that covers everything in this file; every seal that is read names one."""


class AmendmentSchema(Schema):
    """A change of what was sealed, made on purpose."""

    what: str
    """File that was changed, as `seal.files` names it; `runs` for the list of runs."""
    former_sha256: Sha256Hex | None = None
    """Of the file before; of the list: `chain_sha256` of its last run. Absent where there was none."""
    sha256: Sha256Hex | None = None
    """The same now."""
    former: InsidePath | None = None
    """Where the file is kept as it was before, in the session folder."""
    reason: Annotated[str, Field(min_length=1)]
    """Why, in the words of who did it."""
    made: Moment
    """When."""


class NoteSchema(Schema):
    """What somebody noted while it was measured."""

    made: Moment
    """When."""
    text: str = ""
    """In their words."""
    ambient_temp_c: TemperatureDegc | None = None
    """Temperature of the shop then [degC]."""


class SessionFile(Schema):
    """What was done: paths of machine and plan, the bar, one entry per run."""

    format: Literal["dbb-session/1"]
    """Name and version of this format."""
    machine: InsidePath
    """The nominal model that the controller had while measuring, `dbb-machine/1`."""
    plan: InsidePath
    """The test plan as run, `dbb-plan/1`."""
    serial_number: str = ""
    """Of the machine."""
    operator: str = ""
    """Who measured."""
    job: str = ""
    """Job or order number: what it was measured for."""
    ambient_temp_c: TemperatureDegc | None = None
    """Temperature of the shop [degC]."""
    instrument: InstrumentSchema | None = None
    """What the session was begun with; all its runs are virtual, or none."""
    bar: BarSchema | None = None
    """The bar."""
    bar_waiver: str = ""
    """Why it was measured without a fresh calibration of the bar."""
    seal: SealSchema | None = None
    """What was sealed; absent in sessions that were written by hand."""
    amendments: tuple[AmendmentSchema, ...] = ()
    """What was changed on purpose after it was sealed, oldest first."""
    notes: tuple[NoteSchema, ...] = ()
    """What was noted while it was measured, oldest first."""
    set_up_errors: tuple[SetUpErrorsSchema, ...] = ()
    """Micrometer readings of balls that were put up under the spindle, one entry per mounting."""
    runs: tuple[RunSchema, ...] = ()
    """Runs in the order they were started."""
