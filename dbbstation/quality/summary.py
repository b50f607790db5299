"""Findings as plain numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dbbstation.quality.judge import Judgement


def findings_summary(judgement: Judgement) -> list[dict[str, Any]]:
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
        for finding in judgement.findings
    ]
