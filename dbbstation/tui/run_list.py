"""Planned runs by test, each with sign and word."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.service.board import Mark
from dbbstation.tui.panel import Panel, cut, window

if TYPE_CHECKING:
    from dbbstation.service.board import Board

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
