"""What can be said of a cause, and values with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Verdict(StrEnum):
    """What can be said of a cause."""

    IDENTIFIED = "identified"
    AMBIGUOUS = "ambiguous"
    RULED_OUT = "ruled-out"
    NOT_TESTABLE = "not-testable"


@dataclass(frozen=True)
class Value:
    """A number with its standard uncertainty and unit."""

    value: float
    uncertainty: float
    unit: str
