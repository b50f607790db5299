"""Planned runs by test, each with sign and word, and the findings of a circle that awaits its verdict."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.quality.answer import Advice, rank
from dbbstation.quality.finding import FindingVerdict, against_limit
from dbbstation.service.board import Mark
from dbbstation.tui.panel import Panel, cut, lines, window

if TYPE_CHECKING:
    from dbbstation.quality.finding import Finding
    from dbbstation.service.board import Board
    from dbbstation.station.events import RunCompleted

SIGNS = {
    Mark.OPEN: ("·", "dim"),
    Mark.NEXT: ("›", "bold $text-primary"),
    Mark.RUNNING: ("▶", "bold $text-primary"),
    Mark.COMPLETE: ("?", "bold $text-warning"),
    Mark.FLAWED: ("!", "bold $text-error"),
    Mark.ACCEPTED: ("✓", "$text-success"),
    Mark.PASSED: ("–", "$text-warning"),
}

_CELL = 15
"""Columns of a direction, a sign and the longest word."""

_SHORTEST_NAME = 4


class RunList(Panel):
    """List of as many tests as fit around the present one."""

    def text(self, board: Board) -> Content:
        numbered = enumerate(zip(board.tasks, board.marks, strict=True), start=1)
        here = board.announced.number if board.announced else 1
        room = max(self.size.width - 2 * (_CELL + 1), _SHORTEST_NAME)
        rows: list[Content] = []
        current = 0
        for (name, occurrence), group in groupby(numbered, key=lambda item: (item[1][0].test, item[1][0].occurrence)):
            cells = []
            for number, (task, mark) in group:
                current = len(rows) if number == here else current
                cells.append(_cell(task.direction.value, mark, doubted=board.in_doubt(task.test, task.direction)))
            title = name if occurrence == 1 else f"{name} again"
            rows.append(Content(f"{cut(title, room):{room}} ") + Content(" ").join(cells))
        return window(rows, current, self.size.height)


def _cell(direction: str, mark: Mark, *, doubted: bool = False) -> Content:
    (sign, style), word = (("!", "bold $text-error"), "doubted") if doubted else (SIGNS[mark], mark.value)
    return Content.assemble(f"{direction:3} ", (f"{sign} {word}".ljust(_CELL - 4), style))


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
