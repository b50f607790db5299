"""The last messages, newest below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.service.messages import Message, Weight
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.service.board import Board

STYLES = {Weight.NOTE: "", Weight.WARNING: "$text-warning", Weight.FAULT: "bold $text-error"}


class MessageLines(Panel):
    """As many messages as fit, one line each."""

    def text(self, board: Board) -> Content:
        height = max(self.size.height, 1)
        if not board.messages:
            where = f"recording into {board.session}" if board.session else ""
            return Content.styled(where, "dim")
        return lines(*(_line(message, self.size.width) for message in list(board.messages)[-height:]))


def _line(message: Message, width: int) -> Content:
    text = message.text if message.weight is Weight.NOTE else f"{message.weight.value}: {message.text}"
    text = text.replace("\n", " ")
    if len(text) > width > 1:
        text = f"{text[: width - 1]}…"
    return Content.styled(text, STYLES[message.weight])
