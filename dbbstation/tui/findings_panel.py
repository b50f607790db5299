"""What was looked for in a circle that waits for its verdict: number, limit, and a word that a colour repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.quality.finding import Verdict
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.quality.finding import Finding
    from dbbstation.service.board import Board

_ROW = 37
"""Columns of a row: as many as the right side has on the smallest terminal."""

STYLES = {
    Verdict.GOOD: "$text-success",
    Verdict.CANNOT_TELL: "$text-warning",
    Verdict.WRONG: "bold $text-error",
}
"""Green, amber, red."""

_ORDER = list(reversed(STYLES))
"""What is wrong stands first: it must not be what the screen has no room for."""


class FindingsPanel(Panel):
    """A row for each finding, as many as fit."""

    can_grow = True

    def text(self, board: Board) -> Content:
        """Return the findings of the run that was completed last."""
        findings = board.completed.findings if board.completed else ()
        ordered = sorted(findings, key=lambda finding: _ORDER.index(finding.verdict))
        return lines(*(_row(finding) for finding in ordered))


def against_limit(finding: Finding) -> str:
    """Return a finding's number and limit with their unit, as far as there are any."""
    if finding.value is None:
        return ""
    limit = "" if finding.limit is None else f" of {finding.limit:.2f}"
    return f"{finding.value:.2f}{limit} {finding.unit}".rstrip()


def _row(finding: Finding) -> Content:
    name, word, numbers = finding.name.value, finding.verdict.value, against_limit(finding)
    room = max(_ROW - len(name) - len(word) - 1, 0)
    return Content.assemble(f"{name}{numbers:>{room}} ", (word, STYLES[finding.verdict]))
