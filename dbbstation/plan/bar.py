"""The ball bar: calibrated length and excess reading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Annotated

from pydantic import Field

from dbbstation.facts.quantities import ExpansionUmMK, FormUm, Quantity, TemperatureDegc
from dbbstation.facts.record import Day, Moment, Record

BAR_LENGTH = Quantity("mm", 20, 2_000)
"""Plausible lengths of ball bars."""

LONGEST_CALIBRATOR = timedelta(days=5 * 366)
"""Longest age of a calibrator's certificate: the longest usual interval for gauge blocks and step gauges [ILAC-G24]."""

USUAL_TEMP_UNCERTAINTY_K = 0.3
"""Standard uncertainty [K]. A class B thermometer may err by 0.4 K at 20 degC [IEC 60751], 0.23 K as a rectangular
distribution; the bar's temperature also differs a little from the thermometer's."""

STEEL_BAR_UM_M_K = 11.5
"""Thermal expansion of unalloyed steel [µm/(m K)]."""

EXPANSION_UNCERTAINTY = 0.05
"""Relative standard uncertainty of a stated expansion coefficient. For steel, catalogues give 11.5 ± 1 µm/(m K), 0.58
as a rectangular distribution."""

UNKNOWN_BAR_MM = 0.1
"""Assumed length error of an uncalibrated bar, larger than after any calibration [mm]."""

USUAL_READINGS = 200
"""Number of averaged readings on the calibrator: twenty seconds of a display."""


@dataclass(frozen=True)
class Bar(Record):
    """The bar and the calibration of its length, which is compared with the plan and never added to readings."""

    serial_number: Annotated[str, Field(default="")]
    """Serial number of the bar."""
    calibrated_length_mm: Annotated[float, BAR_LENGTH]
    """Calibrated distance between the ball centres [mm]."""
    calibrator_uncertainty_mm: Annotated[float, Quantity("mm", 1e-6, 0.1, or_zero=True)]
    """Standard uncertainty of this length [mm]."""
    calibrated: Moment | None = None
    """Time of the calibration."""
    temp_c: TemperatureDegc | None = None
    """Temperature of the bar at its calibration [degC]."""
    expansion_um_m_k: ExpansionUmMK | None = None
    """Thermal expansion of the bar [µm/(m K)]."""
    stroke_mm: Annotated[float, Quantity("mm", 0.1, 100)] | None = None
    """Travel of its gauge from this length, either way; circles of other radii are impossible [mm]."""
    reading_mm: Annotated[float, BAR_LENGTH] | None = None
    """Reading on the calibrator. The fit accounts for the difference; recorded lengths are never corrected [mm]."""
    temp_uncertainty_k: Annotated[float, Quantity("K", 0.001, 10)] | None = None
    """Standard uncertainty of a temperature of the bar; if stated, the fit accounts for the bar's growth [K]."""
    calibrator_serial_number: str | None = None
    """Serial number of the calibrator."""
    calibrator_certificate: str | None = None
    """Number and issuer of the calibrator's certificate."""
    calibrator_certified: Day | None = None
    """Date of the certificate."""
    calibrator_valid_until: Day | None = None
    """Last day on which the certificate is valid."""
    ball_form_um: FormUm | None = None
    """Largest deviation of the bar's ball from a sphere by its certificate [µm]."""

    def certificate_fault(self, day: date) -> str:
        """Return why the calibrator's certificate is not valid on a day; empty if valid.

        A stated expiry date replaces the longest usual interval.
        """
        of, until = self.calibrator_certified, self.calibrator_valid_until
        if until is not None and day > date.fromisoformat(until):
            return f"the calibrator's certificate was valid until {until}"
        if of is None or (until is not None and of <= day.isoformat()):
            return ""
        if timedelta(0) <= day - date.fromisoformat(of) <= LONGEST_CALIBRATOR:
            return ""
        return f"the calibrator was certified on {of}; without a stated last day its certificate holds for five years from then"

    def reads_long_mm(self, temp_c: float | None) -> tuple[float, float]:
        """Return how much too long the bar is expected to read, with standard uncertainty [mm].

        The value is the excess on the calibrator minus the growth a L (T - T_calibration). Known effects are corrected
        [GUM 3.2.4]. `USUAL_TEMP_UNCERTAINTY_K` replaces an unstated temperature uncertainty. A difference of two
        temperatures has sqrt(2) times the uncertainty of one.
        """
        long_mm = 0.0 if self.reading_mm is None else self.reading_mm - self.calibrated_length_mm
        if temp_c is None or self.temp_c is None or self.expansion_um_m_k is None:
            return long_mm, self.calibrator_uncertainty_mm
        grown_mm = 1e-6 * self.expansion_um_m_k * self.calibrated_length_mm * (temp_c - self.temp_c)
        return long_mm - grown_mm, math.hypot(self.calibrator_uncertainty_mm, self.grown_uncertainty_mm(temp_c) or 0.0)

    def grown_uncertainty_mm(self, temp_c: float | None) -> float | None:
        """Return the standard uncertainty of the thermal growth since calibration [mm]; None if unknown."""
        if self.expansion_um_m_k == 0.0:
            return 0.0
        if temp_c is None or self.temp_c is None or self.expansion_um_m_k is None:
            return None
        usual = USUAL_TEMP_UNCERTAINTY_K if self.temp_uncertainty_k is None else self.temp_uncertainty_k
        mm_per_k = 1e-6 * self.expansion_um_m_k * self.calibrated_length_mm
        of_coefficient = EXPANSION_UNCERTAINTY * (temp_c - self.temp_c)
        return mm_per_k * math.hypot(math.sqrt(2.0) * usual, of_coefficient)

    def lacks(self, temp_c: float | None) -> tuple[str, ...]:
        """Return facts that are missing for an absolute length."""
        if self.expansion_um_m_k == 0.0:
            return ()
        stated = (
            (self.expansion_um_m_k, "thermal expansion of the bar"),
            (self.temp_c, "temperature of the bar at its calibration"),
            (temp_c, "temperature of bar or shop at the measurement"),
        )
        return tuple(name for value, name in stated if value is None)
