"""`dbb-settings/1`: the settings of a shop: instrument, port, bar, limits, number formats, tolerances."""

from typing import Annotated, Literal

from pydantic import Field

from dbbstation.facts.quantities import BarMm, Ordinal, Quantity, TemperatureDegc, Text
from dbbstation.files.yaml.schema import Rules, Schema
from dbbstation.nc.limits import LARGEST_ALLOWED_MM
from dbbstation.plan.plan import Direction
from dbbstation.plan.tolerance import FILTERED, OF_BOTH_DIRECTIONS, USUAL_UPR, CircleFigure, Tolerance

_UM_PER = {"µm": 1.0, "mm": 1e3}


class BarSettings(Schema):
    """The shop's ball bar, with the keys of a session file."""

    serial_number: str = ""
    """Serial number of the bar."""
    calibrated_length_mm: BarMm
    """Distance between the ball centres [mm]; compared with the plan's radii, never added to readings."""
    calibrator_uncertainty_mm: Annotated[float, Quantity("mm", 1e-6, 0.1, or_zero=True)]
    """Standard uncertainty of this length [mm]."""
    temp_c: TemperatureDegc | None = None
    """Temperature of the bar at its calibration [degC]."""


class ProgramSettings(Schema):
    """How NC programs are written."""

    dialect: Text | None = None
    """Language of the control."""
    step_deg: Annotated[float, Quantity("deg", 0.01, 5.0)] | None = None
    """Angle between points of a circle [deg]."""
    chord_um: Annotated[float, Quantity("µm", 0.001, 1000.0)] | None = None
    """Greatest distance between a straight move and the path [µm]."""
    clearance_mm: Annotated[float, Quantity("mm", 0.1, 500.0, or_zero=True)] | None = None
    """Height of rapid moves above the first point [mm]."""


class LimitSettings(Schema):
    """What is refused."""

    largest_correction_mm: Annotated[float, Quantity("mm", 1e-3, LARGEST_ALLOWED_MM)] | None = None
    """A model that shifts any point by more is refused [mm]."""
    largest_loss_percent: Annotated[float, Quantity("%", 0.001, 100, or_zero=True)] | None = None
    """A run that lost more of its samples is repeated, if the plan states no limit [%]."""
    largest_bar_age_h: Annotated[float, Quantity("h", 0.1, 10_000)] | None = None
    """A calibration of the bar that is older is stale [h]."""


class NumberSettings(Schema):
    """Number format of tables from other programs."""

    decimal: Literal[".", ","] | None = None
    """Decimal sign."""
    separator: Literal[",", ";", "\t"] | None = None
    """Separator of columns; absent: a semicolon with decimal commas, else a comma."""

    def _rules(self) -> Rules:
        same = self.decimal is not None and self.decimal == self.separator
        yield same, "decimal sign and separator are both a comma; give `;` or a tab"


class ToleranceSettings(Schema):
    """A tolerance of some circles."""

    quantity: Literal[tuple(map(str, CircleFigure))]  # type: ignore[valid-type]  # the figures have one list
    """Figure of the circle."""
    largest: Annotated[float, Field(gt=0.0)]
    """Greatest size within tolerance, in `unit`."""
    unit: Literal["µm", "mm"]
    """Unit of `largest`."""
    tests: tuple[Text, ...] = ()
    """Tests of the tolerance; absent: all."""
    directions: tuple[Literal["ccw", "cw"], ...] = ()
    """Directions of the tolerance; absent: both. It is not allowed for figures of both directions."""
    filter: Literal["none", 15, 30, 50, 150] | None = None
    """Filter of G, F, G(b) and H: `none`, or its cut-off in undulations per revolution; absent: 30. It is Gaussian, but
    sharp at 30."""

    def _rules(self) -> Rules:
        figure = CircleFigure(self.quantity)
        both = self.directions and figure in OF_BOTH_DIRECTIONS
        yield both, f"{self.quantity} is of both directions: leave `directions` out"
        unfiltered = self.filter is not None and figure not in FILTERED
        yield unfiltered, f"no filter acts on {self.quantity}: leave `filter` out"
        Quantity("µm", 0.01, 5_000).check(self.largest * _UM_PER[self.unit])

    def to_domain(self) -> Tolerance:
        """Return the tolerance in micrometres."""
        directions = tuple(map(Direction, self.directions))
        upr = USUAL_UPR if self.filter is None else 0 if self.filter == "none" else self.filter
        return Tolerance(CircleFigure(self.quantity), self.largest * _UM_PER[self.unit], self.tests, directions, upr)


class ReportSettings(Schema):
    """Head of reports."""

    laboratory: Text | None = None
    """Name and address of the measuring laboratory."""
    customer: Text | None = None
    """Name and address of the machine's owner."""
    logo: Text | None = None
    """Picture of the shop, PNG or JPEG; a path from this file's folder."""


class SettingsFile(Schema):
    """Defaults of a shop's commands; every key except the format may be absent."""

    format: Literal["dbb-settings/1"]
    """Name and version of this format."""
    instrument: Text | None = None
    """Name of an instrument, or path of a protocol file from this file's folder."""
    profile: Text | None = None
    """Variant of the instrument, if not the usual one."""
    port: Text | None = None
    """Port that the instrument is connected to, or a URL."""
    baud: Ordinal | None = None
    """Baud rate, if the instrument is not set to the usual one."""
    serial_number: Text | None = None
    """Serial number of the machine; noted in every session."""
    bar: BarSettings | None = None
    """The ball bar."""
    program: ProgramSettings = ProgramSettings()
    """How NC programs are written."""
    limits: LimitSettings = LimitSettings()
    """What is refused."""
    numbers: NumberSettings | None = None
    """Number format of tables from other programs."""
    simulators: tuple[Annotated[str, Field(pattern="^[0-9a-f]{64}$")], ...] | None = None
    """Simulators that `mismatch` may run, by the SHA-256 that it prints; ignored in a file beside sessions, which
    others may write."""
    tolerances: tuple[ToleranceSettings, ...] | None = None
    """Tolerances of circles."""
    report: ReportSettings = ReportSettings()
    """Head of reports."""

    def _rules(self) -> Rules:
        alone = self.profile is not None and self.instrument is None
        yield alone, "a profile needs `instrument` in the same file"
