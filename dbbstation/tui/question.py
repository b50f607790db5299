"""Asked before a running circle is given up."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Static

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.binding import BindingType


class GiveUpQuestion(ModalScreen[bool]):
    """Returns whether to end the run."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("y", "answer(True)", "Yes"),
        ("n,escape,ctrl+c,q", "answer(False)", "Go on"),
    ]

    def __init__(self, run: str, act: str) -> None:
        super().__init__()
        self.run = run
        self._act = act

    def compose(self) -> ComposeResult:
        text = (
            f"The circle {self.run} is being recorded. {self._act} all the same?\n\n"
            "What was recorded so far is kept, but the run has to be measured again. The machine is not stopped.\n\n"
            f"Y  {self._act.lower()}      N or Esc  go on"
        )
        with Vertical():
            yield Static(text, markup=False)

    def action_answer(self, answer: bool) -> None:  # noqa: FBT001 - called by a key's action string
        self.dismiss(answer)


class YesQuestion(GiveUpQuestion):
    """Returns whether to do what the text asks."""

    def __init__(self, text: str) -> None:
        super().__init__("", "")
        self._text = text

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Static(self._text, markup=False)
