"""The results of `jig`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dbbstation.plan.repeatability import HolderResult


@dataclass(frozen=True)
class MeasuredBall:
    """A measured ball: its centre in the jig's frame and its change since the former jig file; None for a new ball."""

    centre_mm: tuple[float, ...]
    change_um: tuple[float, ...] | None


@dataclass(frozen=True)
class SheetResult:
    """Output of `jig sheet`."""

    jig: str
    balls: Mapping[str, MeasuredBall]
    not_in_the_sheet: tuple[str, ...]


@dataclass(frozen=True)
class HoldersResult:
    """Result of `jig holders`."""

    holders: Mapping[str, HolderResult]
    jig: str | None
