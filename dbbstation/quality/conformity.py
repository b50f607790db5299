"""Decide whether a figure keeps a limit, considering its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Conformity(StrEnum):
    """Decision about a limit by ISO 14253-1."""

    WITHIN = "within"
    """The limit is kept for every value within U of the figure."""
    EXCEEDED = "exceeded"
    """The limit is exceeded for every value within U of the figure."""
    UNDECIDED = "cannot tell"
    """The limit is within U of the figure, or U is unknown."""


@dataclass(frozen=True)
class Size:
    """A figure of one circle as measured.

    Attributes:
        u_um: standard uncertainty; None if a contribution is unknown.
    """

    um: float
    u_um: float | None
    why_not: str = ""
    known_um: float = 0.0


def conformity(size: Size, largest_um: float, coverage_factor: float) -> Conformity:
    """Compare a figure with a limit."""
    if size.u_um is None:
        return Conformity.UNDECIDED
    expanded = coverage_factor * size.u_um
    if size.um + expanded <= largest_um:
        return Conformity.WITHIN
    return Conformity.EXCEEDED if size.um - expanded > largest_um else Conformity.UNDECIDED
