"""What screens show beside events."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.plan.plan import PlannedTest


@dataclass(frozen=True)
class Shown:
    """Plan and plate.

    Attributes:
        bores: number and x, y on the plate [mm].
        cell_aspect: height over width of a terminal's cell.
    """

    plan: str
    bores: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    cell_aspect: float = 2.0
    tests: Mapping[str, PlannedTest] = field(default_factory=dict)
