"""Findings about runs: number, limit and verdict of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.quality.finding import Finding


@dataclass(frozen=True)
class FindingResult:
    """One thing that was looked for in one run.

    Attributes:
        name: what was looked for.
        value: in the unit; None where it cannot be told.
        limit: likewise.
        unit: of both.
        verdict: `good`, `wrong` or `cannot tell`.
        text: in words.
    """

    name: str
    value: float | None
    limit: float | None
    unit: str
    verdict: str
    text: str


def finding_results(findings: Iterable[Finding]) -> tuple[FindingResult, ...]:
    """Return every finding of a run."""
    return tuple(
        FindingResult(str(one.name), one.value, one.limit, one.unit, str(one.verdict), one.text) for one in findings
    )
