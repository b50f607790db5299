"""The result of `plot`."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.facts.run import OfRunInSession
from dbbstation.results.circle_figures import PlaneVector


@dataclass(frozen=True)
class DrawnCircle(OfRunInSession):
    """A drawn run."""

    g_um: float
    u_g_um: float | None
    centre_um: PlaneVector


@dataclass(frozen=True)
class PlotResult:
    """A figure of circles."""

    figure: str
    kind: str
    filter: str
    drawn: tuple[DrawnCircle, ...]
    not_drawn: int
    one_direction_only: tuple[str, ...]
