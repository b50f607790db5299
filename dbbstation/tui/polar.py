"""The polar trace: magnified deviations about the nominal circle in braille dots."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from dbbstation.tui import braille

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.tui.braille import Plane

NOMINAL_SHARE, BAND_SHARE = 0.58, 0.34
"""Radius of the nominal circle, and its increase for a deviation of full scale, as shares of the dial's radius."""

SMALLEST_SCALE_UM = 2.0
"""Smallest scale [µm]: a smaller one would show only noise."""

CELL_ASPECT = 2.0
"""Height of a terminal's cell over its width, as most fonts have it."""

_DOTS_BETWEEN_MARKS = 3
"""Spacing of the dots of a dotted circle; on the rings of the scale it is double."""

_MARGIN_DOTS = 4.0
"""Margin for the letters at the rim."""


@dataclass(frozen=True)
class Dial:
    """Geometry of a field of cells."""

    columns: int
    rows: int
    cell_aspect: float = CELL_ASPECT

    @cached_property
    def dot_aspect(self) -> float:
        return self.cell_aspect * braille.CELL_WIDE / braille.CELL_HIGH

    @cached_property
    def radius(self) -> float:
        """Return the drawing's radius [dot widths]."""
        wide, high = self.columns * braille.CELL_WIDE, self.rows * braille.CELL_HIGH * self.dot_aspect
        return max(min(wide, high) / 2.0 - _MARGIN_DOTS, 1.0)

    def empty(self) -> Plane:
        return braille.empty(self.columns, self.rows)

    def places(self, theta_deg: Floats, share: Floats | float) -> tuple[Floats, Floats]:
        """Return x and y of points in dots from the upper left corner, shape (n,) each."""
        theta = np.radians(theta_deg)
        x = self.columns * braille.CELL_WIDE / 2.0 + self.radius * share * np.cos(theta)
        y = self.rows * braille.CELL_HIGH / 2.0 - self.radius * share * np.sin(theta) / self.dot_aspect
        return x, y

    def cell(self, theta_deg: float, share: float) -> tuple[int, int]:
        """Return row and column of the cell at a point, limited to the field."""
        x, y = self.places(np.array([theta_deg]), share)
        row, column = int(y[0] // braille.CELL_HIGH), int(x[0] // braille.CELL_WIDE)
        return min(max(row, 0), self.rows - 1), min(max(column, 0), self.columns - 1)

    def magnification(self, scale_um: float, radius_mm: float) -> float:
        return (BAND_SHARE / scale_um) / (NOMINAL_SHARE / (1e3 * radius_mm))


_Values = TypeVar("_Values", float, "Floats")


def share_of(deviation_um: _Values, scale_um: float) -> _Values:
    """Return deviations as shares of the dial's radius."""
    return NOMINAL_SHARE + BAND_SHARE * deviation_um / scale_um


def draw_trace(
    plane: Plane,
    dial: Dial,
    theta_deg: Floats,
    deviation_um: Floats,
    scale_um: float,
    *,
    thick: bool = False,
) -> None:
    """Add a trace's dots and lines to a plane."""
    share = share_of(deviation_um, scale_um)
    for outward in (0.0, 1.0 / dial.radius) if thick else (0.0,):
        braille.light(plane, *braille.connect(*dial.places(theta_deg, share + outward)))


def draw_scale(plane: Plane, dial: Dial, start_deg: float | None) -> None:
    """Add the nominal circle, rings at plus and minus the scale, and a spoke at the start."""
    for share, spacing in (
        (NOMINAL_SHARE, _DOTS_BETWEEN_MARKS),
        (NOMINAL_SHARE + BAND_SHARE, 2 * _DOTS_BETWEEN_MARKS),
        (NOMINAL_SHARE - BAND_SHARE, 2 * _DOTS_BETWEEN_MARKS),
    ):
        count = max(int(2.0 * np.pi * dial.radius * share / spacing), 12)
        braille.light(plane, *dial.places(np.linspace(0.0, 360.0, count, endpoint=False), share))
    if start_deg is not None:
        shares = np.arange(NOMINAL_SHARE - BAND_SHARE, 1.0, 1.0 / dial.radius)
        braille.light(plane, *dial.places(np.full_like(shares, start_deg), shares))


def grown_scale_um(scale_um: float, largest_um: float) -> float:
    """Return the scale, grown to the next of 1, 2, 5, 10, … if needed."""
    needed = max(scale_um, SMALLEST_SCALE_UM)
    if largest_um <= needed:
        return needed
    decade = 10.0 ** np.floor(np.log10(largest_um))
    # The last step catches a decade that rounding put just below.
    return float(next(step * decade for step in (1.0, 2.0, 5.0, 10.0, 20.0) if step * decade >= largest_um))
