"""Questions whose answer is chosen from a list, or typed."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from dbbstation.tui.cursor import mark_chosen
from dbbstation.tui.texts import TYPED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.app import ComposeResult
    from textual.binding import BindingType


class ChooseQuestion(ModalScreen[int | None]):
    """Returns the place of the choice, or None."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,q,ctrl+c", "dismiss(None)", "Back")]

    def __init__(self, title: str, labels: Sequence[str], at: int = 0) -> None:
        super().__init__()
        self._title, self._rows, self._at = title, [Content(label) for label in labels], at

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Static(self._title, markup=False)
            yield OptionList(*(Option(row) for row in self._rows))

    def on_mount(self) -> None:
        options = self.query_one(OptionList)
        options.highlighted = min(max(self._at, 0), len(self._rows) - 1) if self._rows else None
        mark_chosen(options, self._rows)
        options.focus()

    def on_option_list_option_highlighted(self) -> None:
        mark_chosen(self.query_one(OptionList), self._rows)

    def on_option_list_option_selected(self, chosen: OptionList.OptionSelected) -> None:
        self.dismiss(chosen.option_index)


class TypeQuestion(ModalScreen[str | None]):
    """Returns the stripped text, or None."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,ctrl+c", "dismiss(None)", "Back")]

    def __init__(self, title: str, text: str = "") -> None:
        super().__init__()
        self._title, self._text = title, text

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Static(self._title, markup=False)
            yield Input(value=self._text, placeholder=TYPED)

    def on_input_submitted(self, submitted: Input.Submitted) -> None:
        self.dismiss(submitted.value.strip())
