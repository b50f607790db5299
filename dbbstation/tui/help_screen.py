"""Help on a screen and its keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import VerticalScroll
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Static

from dbbstation.tui.help_texts import HELP, HELP_CLOSES, KEY_NAMES
from dbbstation.tui.panel import lines

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from textual.app import ComposeResult
    from textual.binding import BindingType

_KEY = 8


class HelpScreen(ModalScreen[None]):
    """Help, drawn over the screen that it explains."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,f1,question_mark,q", "dismiss", "Close")]

    def __init__(self, name: str, without: Collection[str] = ()) -> None:
        super().__init__()
        self._help = name
        self._without = frozenset(without)

    def compose(self) -> ComposeResult:
        here, everywhere = HELP[self._help], HELP["everywhere"]
        with VerticalScroll():
            yield Static(Content.styled(here.title, "bold"))
            yield Static(Content(HELP_CLOSES))
            yield Static(_keys(here.keys))
            yield Static(Content.styled(everywhere.title, "bold"))
            yield Static(
                _keys({key: text for key, text in everywhere.keys.items() if key not in {*here.keys, *self._without}})
            )
            for paragraph in here.shows:
                yield Static(Content(paragraph))


def _keys(keys: Mapping[str, str]) -> Content:
    return lines(
        *(
            Content.assemble((f"{KEY_NAMES.get(key, key.upper()):{_KEY}}", "bold"), sentence)
            for key, sentence in keys.items()
        )
    )
