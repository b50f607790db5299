"""`dbb-bar/1`: the reading of a bar on its calibrator."""

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from dbbstation.errors import Problem
from dbbstation.facts import of_facts
from dbbstation.facts.quantities import BarMm, ExpansionUmMK, FormUm, Quantity, TemperatureDegc, Text
from dbbstation.facts.record import Day, Moment
from dbbstation.files.atomic import write_text
from dbbstation.files.source_text import without_faults
from dbbstation.files.yaml.out import yaml_text
from dbbstation.files.yaml.schema import Schema, format_of, read_valid
from dbbstation.plan.bar import Bar


class CalibratorSchema(Schema):
    """The block of known length that the bar was put on."""

    serial_number: Text
    """Serial number of the block."""
    length_mm: BarMm
    """Length at 20 degC by its certificate [mm]."""
    uncertainty_um: FormUm
    """Standard uncertainty of the length: half of a certificate's U (k = 2) [µm]."""
    certified: Day
    """Date of the certificate."""
    valid_until: Day | None = None
    """Last day on which the certificate is valid."""
    certificate: str = ""
    """Number and issuer of the certificate."""
    expansion_um_m_k: ExpansionUmMK = 0.0
    """Thermal expansion; absent: zero, since Zerodur has less than 0.05 [µm/(m K)]."""


class ReadingsSchema(Schema):
    """Readings of the instrument while the bar was on the calibrator."""

    instrument: str
    """Name of the instrument."""
    count: Annotated[int, Field(ge=2)]
    """Readings."""
    mean_mm: BarMm
    """Their mean [mm]."""
    uncertainty_um: FormUm
    """Standard uncertainty of the mean, resolution included [µm]."""
    scatter_um: FormUm
    """Standard deviation of single readings [µm]."""
    resolution_um: Annotated[float, Quantity("µm", 0.0001, 100)]
    """Step of the readings [µm]."""


class BarFile(Schema):
    """One calibration of one bar."""

    format: Literal["dbb-bar/1"]
    """Name and version of this format."""
    serial_number: Text
    """Serial number of the bar."""
    calibrated: Moment
    """Time of the reading on the calibrator."""
    temp_c: TemperatureDegc
    """Temperature of the bar at this time [degC]."""
    temp_uncertainty_k: Annotated[float, Quantity("K", 0.001, 10)]
    """Standard uncertainty of a temperature of the bar, on the calibrator and during measurements [K]."""
    expansion_um_m_k: ExpansionUmMK
    """Thermal expansion of the bar [µm/(m K)]."""
    ball_form_um: FormUm | None = None
    """Largest deviation of the bar's ball from a sphere, by the ball's certificate [µm]."""
    calibrator: CalibratorSchema
    """The calibrator of the bar."""
    readings: ReadingsSchema
    """The readings on the calibrator."""

    @property
    def length_mm(self) -> float:
        """Length of the calibrator at the temperature of the calibration [mm]."""
        grown = 1e-6 * self.calibrator.expansion_um_m_k * (self.temp_c - 20.0)
        return self.calibrator.length_mm * (1.0 + grown)

    @property
    def uncertainty_mm(self) -> float:
        """Return the standard uncertainty of reading minus true distance, from calibrator and mean reading [mm]."""
        return 1e-3 * math.hypot(self.calibrator.uncertainty_um, self.readings.uncertainty_um)

    @property
    def misread(self) -> str:
        """Return a sentence on an implausible reading; empty if it is plausible."""
        if 1e3 * abs(self.readings.mean_mm - self.length_mm) <= LARGEST_OFF_UM:
            return ""
        return f"the bar read {self.readings.mean_mm:g} mm on a calibrator of {self.length_mm:g} mm"

    def to_bar(self, stroke_mm: float | None) -> Bar:
        """Return the bar in the form of a session.

        Args:
            stroke_mm: travel of its gauge by the instrument file; None if not stated.
        """
        return of_facts(
            Bar,
            self,
            calibrated_length_mm=self.length_mm,
            calibrator_uncertainty_mm=self.uncertainty_mm,
            stroke_mm=stroke_mm,
            reading_mm=self.readings.mean_mm,
            calibrator_serial_number=self.calibrator.serial_number,
            calibrator_certificate=self.calibrator.certificate or None,
            calibrator_certified=self.calibrator.certified,
            calibrator_valid_until=self.calibrator.valid_until,
        )


def parse_bar(path: Path, faults: list[Problem]) -> BarFile | None:
    """Read the calibration of a bar; None with faults added to `faults`."""
    read = read_valid(path, BarFile, faults)
    if read is None:
        return None
    document, bar = read
    if bar.misread:
        document.fault(("readings", "mean_mm"), bar.misread, AFTER_MISREAD)
        return None
    return bar


def read_bar(path: Path) -> BarFile:
    """Read the calibration of a bar.

    Raises:
        InputError: every fault with its place.
    """
    return without_faults(parse_bar, path)


def write_bar(path: Path, bar: BarFile, *, force: bool = False) -> None:
    """Write the calibration of a bar.

    Raises:
        OutputError: the file exists and `force` is not given, or it cannot be written.
    """
    data = {**bar.model_dump(exclude_defaults=True), "format": format_of(BarFile)}
    write_text(path, yaml_text(data), force=force)


LARGEST_OFF_UM = 1000.0
"""Largest plausible error of a display [µm]. A display that was preset by hand errs by some micrometres. An error of a
millimetre means that it was not preset, or that the calibrator is another one."""

AFTER_MISREAD = "preset the display to the calibrator's length, or check which calibrator and bar it was"
"""Advice for such a display."""
