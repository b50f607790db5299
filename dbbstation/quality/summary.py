"""Findings as plain numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dbbstation.quality.finding import Finding


def findings_summary(findings: Iterable[Finding]) -> list[dict[str, Any]]:
    """Every finding of a run: name, value, limit, unit, verdict (`good`, `wrong`, `cannot tell`) and text."""
    return [
        {
            "name": str(finding.name),
            "value": finding.value,
            "limit": finding.limit,
            "unit": finding.unit,
            "verdict": str(finding.verdict),
            "text": finding.text,
        }
        for finding in findings
    ]
