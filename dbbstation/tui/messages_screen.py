"""The last messages in single lines, newest last; all messages in full, newest first."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import VerticalScroll
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Static

from dbbstation.service.board import Weight
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.app import ComposeResult
    from textual.binding import BindingType

    from dbbstation.service.board import Board, Message

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


class MessagesScreen(ModalScreen[None]):
    """All messages, drawn over the screen that they belong to."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,j,q", "dismiss", "Close")]

    def __init__(self, messages: Sequence[Message]) -> None:
        super().__init__()
        self._messages = tuple(reversed(messages))

    def compose(self) -> ComposeResult:
        with VerticalScroll():
            yield Static(Content.styled("Messages, the newest first. Esc or J closes.", "bold"))
            for message in self._messages:
                word = "" if message.weight is Weight.NOTE else f"{message.weight}: "
                yield Static(Content.styled(f"{word}{message.text}", STYLES[message.weight]))
            if not self._messages:
                yield Static(Content("There are none."))
