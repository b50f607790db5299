"""The ball bar that measures a plan: its length on its calibrator, and what it reads too long."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from datetime import datetime

USUAL_TEMP_UNCERTAINTY_K = 0.3
"""A thermometer of class B may be off by 0.4 K at 20 degC [IEC 60751]; as a rectangular distribution that is 0.23 K, and the bar is
not quite as warm as it [K]."""

STEEL_BAR_UM_M_K = 11.5
"""Thermal expansion of unalloyed steel [µm/(m K)]."""

USUAL_READINGS = 200
"""Readings on the calibrator that are averaged: of a display twenty seconds."""


@dataclass(frozen=True)
class Bar:
    """The bar: nothing of it is added to readings; its length is held against the plan's radii.

    Attributes:
        serial_number: of the bar.
        calibrated_length_mm: distance between the ball centres that its calibration found [mm].
        calibrator_uncertainty_mm: of that length, one standard deviation [mm].
        calibrated: when; None where not noted.
        temp_c: of the bar then [degC]; None where not noted.
        expansion_um_m_k: thermal expansion [µm/(m K)]; None where not noted.
        stroke_mm: travel of its gauge from that length, either way [mm]; None where not noted.
        reading_mm: what it read on its calibrator [mm]; None where not noted.
        temp_uncertainty_k: standard uncertainty of a temperature of the bar [K]; None where not noted.
        calibrator_serial_number: of the calibrator; None where not noted.
    """

    serial_number: str
    calibrated_length_mm: float
    calibrator_uncertainty_mm: float
    calibrated: datetime | None
    temp_c: float | None
    expansion_um_m_k: float | None
    stroke_mm: float | None = None
    reading_mm: float | None = None
    temp_uncertainty_k: float | None = None
    calibrator_serial_number: str | None = None

    def reads_long_mm(self, temp_c: float | None) -> tuple[float, float]:
        """Return what the bar is expected to read less the true distance, and the standard uncertainty of that [mm].

        On its calibrator it read so much more than the calibrator's length. A bar that has grown since reads so much less, as
        its gauge has to travel less: - a L (T - T_calibration). The temperature counts where its uncertainty is stated; that
        of a difference is sqrt(2) times that of each.

        Args:
            temp_c: of the bar while it measures [degC]; None where not known.
        """
        long_mm = 0.0 if self.reading_mm is None else self.reading_mm - self.calibrated_length_mm
        if temp_c is None or self.temp_c is None or self.expansion_um_m_k is None or self.temp_uncertainty_k is None:
            return long_mm, self.calibrator_uncertainty_mm
        mm_per_k = 1e-6 * self.expansion_um_m_k * self.calibrated_length_mm
        of_temperature = mm_per_k * math.sqrt(2.0) * self.temp_uncertainty_k
        uncertainty_mm = math.hypot(self.calibrator_uncertainty_mm, of_temperature)
        return long_mm - mm_per_k * (temp_c - self.temp_c), uncertainty_mm
