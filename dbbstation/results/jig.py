"""The results of `jig`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dbbstation.plan.repeatability import HolderResult


@dataclass(frozen=True)
class MeasuredBall:
    """A measured ball.

    Attributes:
        centre_mm: X, Y, Z in the jig's frame.
        change_um: against the former jig, X, Y, Z; None for a new ball.
    """

    centre_mm: tuple[float, ...]
    change_um: tuple[float, ...] | None


@dataclass(frozen=True)
class SheetResult:
    """What `jig sheet` wrote."""

    jig: str
    balls: Mapping[str, MeasuredBall]
    not_in_the_sheet: tuple[str, ...]


@dataclass(frozen=True)
class HoldersResult:
    """What `jig holders` found.

    Attributes:
        jig: written file, or None.
    """

    holders: Mapping[str, HolderResult]
    jig: str | None
