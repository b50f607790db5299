"""All messages in full, the newest first."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import VerticalScroll
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Static

from dbbstation.service.messages import Weight
from dbbstation.tui import texts
from dbbstation.tui.message_lines import STYLES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.app import ComposeResult
    from textual.binding import BindingType

    from dbbstation.service.messages import Message


class MessagesScreen(ModalScreen[None]):
    """Precedes the screen whose messages it shows."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,j,q", "dismiss", "Close")]

    def __init__(self, messages: Sequence[Message]) -> None:
        super().__init__()
        self._messages = tuple(reversed(messages))

    def compose(self) -> ComposeResult:
        with VerticalScroll():
            yield Static(Content.styled(texts.MESSAGES_TITLE, "bold"))
            for message in self._messages:
                word = "" if message.weight is Weight.NOTE else f"{message.weight}: "
                yield Static(Content.styled(f"{word}{message.text}", STYLES[message.weight]))
            if not self._messages:
                yield Static(Content(texts.MESSAGES_NONE))
