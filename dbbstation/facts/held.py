"""The report's verdict and its tolerances."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.facts import OfRun


@dataclass(frozen=True)
class ReportVerdict:
    """The report's first statement."""

    kind: str
    headline: str
    reasons: tuple[str, ...]
    to_do: tuple[str, ...]


@dataclass(frozen=True)
class WorstCircle(OfRun):
    """The circle with the largest toleranced figure.

    Attributes:
        expanded_um: U = k u; None if unknown.
    """

    um: float
    expanded_um: float | None
    why_not: str | None


@dataclass(frozen=True, kw_only=True)
class HeldTolerance:
    """A tolerance compared with measured circles [ISO 14253-1].

    Attributes:
        conformity: `exceeded` if one circle exceeds it, else `cannot tell` if one is within U; None without circles.
        within: whether no circle exceeds it or is undecided.
        worst: circle with the largest figure, or None.
    """

    quantity: str
    filter: str | None
    largest_um: float
    tests: tuple[str, ...]
    directions: tuple[str, ...]
    conformity: str | None
    within: bool
    exceeded: int
    undecided: int
    circles: int
    worst: WorstCircle | None


@dataclass(frozen=True, kw_only=True)
class ComparedTolerance(HeldTolerance):
    """A tolerance compared with present and former circles; None without applicable circles."""

    before: HeldTolerance | None


@dataclass(frozen=True, kw_only=True)
class ToleranceOfTest(ComparedTolerance):
    """A tolerance compared with the circles of one test."""

    test: str
