"""A text on the screen, updated only when it changes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content
from textual.widgets import Static

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dbbstation.service.board import Board


class Panel(Static):
    """A panel whose text shows the board."""

    can_grow = False
    """Whether the height follows the text; a new layout needs much more time than a new text."""

    def __init__(self, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__("", id=id, markup=False)
        self._shown = Content()

    def text(self, board: Board) -> Content:
        raise NotImplementedError

    def show(self, board: Board) -> None:
        text = self.text(board)
        if not text.is_same(self._shown):
            self._shown = text
            self.update(text, layout=self.can_grow)


def lines(*rows: Content) -> Content:
    """Return rows as one text, one below the other."""
    return Content("\n").join(rows)


def window(rows: Sequence[Content], at: int, height: int) -> Content:
    """Return the rows about one of them that fit into a height."""
    height = max(height, 1)
    first = min(max(at - height // 2, 0), max(len(rows) - height, 0))
    return lines(*rows[first : first + height])


def cut(text: str, room: int) -> str:
    """Return a text with an ellipsis instead of what does not fit."""
    return text if len(text) <= room else f"{text[: room - 1]}…"
