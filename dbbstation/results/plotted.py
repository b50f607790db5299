"""What a figure of circles shows: the result of `plot`."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.results.circle_figures import PlaneVector


@dataclass(frozen=True)
class DrawnCircle:
    """A run on the sheet.

    Attributes:
        direction: `ccw` or `cw`.
        repeat: counts runs of this test and direction.
        u_g_um: its standard uncertainty; None where not known [µm].
        centre_um: least-squares centre less the commanded one [µm].
    """

    session: str
    test: str
    direction: str
    repeat: int
    g_um: float
    u_g_um: float | None
    centre_um: PlaneVector


@dataclass(frozen=True)
class PlotResult:
    """A figure.

    Attributes:
        kind: what it shows of the circles.
        drawn: runs in drawing order.
        one_direction_only: tests that were measured in one direction, in words.
    """

    figure: str
    kind: str
    filter: str
    drawn: tuple[DrawnCircle, ...]
    not_drawn: int
    one_direction_only: tuple[str, ...]
