"""Findings of a channel without held-out parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.inference.left_over import left_over
from dbbstation.inference.levels_of import levels_of
from dbbstation.inference.read_off import Trial, read_off

if TYPE_CHECKING:
    from dbbstation.inference.read_off import CauseFinding
    from dbbstation.inference.settle import Settled


def read_by_levels(settled: Settled, trial: Trial | None = None) -> tuple[CauseFinding, ...]:
    """Every finding, read off the levels of all rows."""
    return read_off(settled, trial or Trial(), levels_of(settled, left_over(settled), None))
