"""What a report decides: its verdict, and the shop's tolerances held against circles."""

from __future__ import annotations

from dataclasses import dataclass

from dbbstation.facts.run import OfRun


@dataclass(frozen=True)
class ReportVerdict:
    """The report's first statement.

    Attributes:
        kind: `within`, `exceeded`, `cannot tell`, or `none` without tolerances.
        reasons: a sentence for each broken tolerance.
        to_do: in order.
    """

    kind: str
    headline: str
    reasons: tuple[str, ...]
    to_do: tuple[str, ...]


@dataclass(frozen=True)
class WorstCircle(OfRun):
    """The circle with the largest toleranced figure.

    Attributes:
        direction: `ccw` or `cw`; `both` for both together.
        expanded_um: U = k u; None if unknown.
        why_not: None if known.
    """

    um: float
    expanded_um: float | None
    why_not: str | None


@dataclass(frozen=True, kw_only=True)
class HeldTolerance:
    """A tolerance against circles [ISO 14253-1].

    Attributes:
        filter: of the figure in words, or None.
        tests: empty for all.
        directions: empty for both.
        conformity: `exceeded` if one circle exceeds it, else `cannot tell` if one is within U; None without circles.
        within: whether no circle exceeds it or is undecided.
        exceeded: number of circles.
        undecided: number of circles within U.
        circles: number that it applies to.
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
    """A tolerance held against circles now, and against those before.

    Attributes:
        before: None without applicable circles.
    """

    before: HeldTolerance | None


@dataclass(frozen=True, kw_only=True)
class ToleranceOfTest(ComparedTolerance):
    """A tolerance against the circles of one test."""

    test: str
