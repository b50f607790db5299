"""What a figure with an uncertainty says of a limit."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Conformity(StrEnum):
    """What a figure with an uncertainty says of a limit, by the decision rule of ISO 14253-1."""

    WITHIN = "within"
    """The limit is kept, whatever the figure is within U."""
    EXCEEDED = "exceeded"
    """The limit is passed, whatever the figure is within U."""
    UNDECIDED = "cannot tell"
    """The limit lies within U of the figure."""


@dataclass(frozen=True)
class Size:
    """A figure of one circle as measured.

    Attributes:
        um: its size [µm].
        u_um: its standard uncertainty [µm].
    """

    um: float
    u_um: float


def conformity(size: Size, largest_um: float, coverage_factor: float) -> Conformity:
    """Hold a figure against a limit.

    Args:
        size: the figure.
        largest_um: the limit [µm].
        coverage_factor: k of U = k u.
    """
    expanded = coverage_factor * size.u_um
    if size.um + expanded <= largest_um:
        return Conformity.WITHIN
    return Conformity.EXCEEDED if size.um - expanded > largest_um else Conformity.UNDECIDED
