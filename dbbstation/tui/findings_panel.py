"""Findings of a circle that awaits its verdict: number, limit, and a coloured word."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.quality.answer import Advice, rank
from dbbstation.quality.finding import FindingVerdict, against_limit
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.quality.finding import Finding
    from dbbstation.service.board import Board
    from dbbstation.station.events import RunCompleted

_ROW = 37
"""Columns of a row before the panel has a size, as on the right side of the smallest terminal."""

STYLES = {
    FindingVerdict.GOOD: "$text-success",
    FindingVerdict.CANNOT_TELL: "$text-warning",
    FindingVerdict.WRONG: "bold $text-error",
}
"""Green, amber, red."""

_ORDER = list(reversed(STYLES))
"""Order of the findings: faults are first, so that a small screen shows them."""

WORD_STYLES = {
    Advice.GOOD: "bold reverse $text-success",
    Advice.CANNOT_TELL: "bold reverse $text-warning",
    Advice.REPEAT: "bold reverse $text-error",
}
"""Styles of a run's verdict, visible without colours too."""


class FindingsPanel(Panel):
    """The run's verdict, then as many findings as fit."""

    can_grow = True

    def text(self, board: Board) -> Content:
        if board.completed is None:
            return Content("")
        ordered = sorted(board.completed.findings, key=lambda one: (_ORDER.index(one.verdict), rank(one)))
        return lines(word_of(board.completed), *(_row(finding, self.content_size.width or _ROW) for finding in ordered))


def word_of(completed: RunCompleted) -> Content:
    """Return the highlighted verdict on a run."""
    word = completed.answer.word
    return Content.styled(f" {word} ", WORD_STYLES[word])


def _row(finding: Finding, width: int) -> Content:
    name, word, numbers = finding.name.value, finding.verdict.value, against_limit(finding)
    room = max(width - len(name) - len(word) - 1, 0)
    if (
        len(numbers) >= room
    ):  # at least one column apart: the limit is what there is no room for, it stands in the sentence above
        numbers = "" if finding.value is None else f"{finding.value:.1f} {finding.unit}".rstrip()
    return Content.assemble(f"{name}{numbers:>{room}} ", (word, STYLES[finding.verdict]))
