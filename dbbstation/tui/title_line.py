"""The top line: which plan, which of its runs, in which state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.tui.panel import Panel
from dbbstation.tui.texts import VIRTUAL_BANNER

if TYPE_CHECKING:
    from dbbstation.service.board import Board


class TitleLine(Panel):
    """One line over the whole width.

    Args:
        plan: name of the plan.
    """

    def __init__(self, plan: str, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._plan = plan

    def text(self, board: Board) -> Content:
        """Return the line."""
        parts = [Content.styled(VIRTUAL_BANNER, "reverse bold $text-warning")] if board.virtual else []
        parts.append(Content.styled(f" {self._plan}", "bold"))
        if board.announced is not None and board.finished is None:
            parts.append(Content(f"run {board.announced.number} of {board.announced.count}"))
            parts.append(Content.styled(board.announced.run.label, "bold"))
        parts.append(Content(str(board.state) if board.state else "opening"))
        if board.virtual:
            return parts[0] + Content(" · ").join(parts[1:])
        return Content(" · ").join(parts)
