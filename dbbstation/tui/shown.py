"""Content of screens that does not come from events."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.plan.plan import PlannedTest


@dataclass(frozen=True)
class Shown:
    """Plan and plate, and the shop's text for an operator in trouble."""

    plan: str
    bores: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    cell_aspect: float = 2.0
    tests: Mapping[str, PlannedTest] = field(default_factory=dict)
    trouble: str = ""
