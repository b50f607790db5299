"""Asked before a running circle is given up."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Static

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.binding import BindingType


class QuitQuestion(ModalScreen[bool]):
    """Returns whether to quit.

    Args:
        run: name of the run that goes on.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        ("y", "answer(True)", "Quit"),
        ("n,escape,ctrl+c,q", "answer(False)", "Go on"),
    ]

    DEFAULT_CSS = """
    QuitQuestion {
        align: center middle;
        & > Vertical { width: 60; max-width: 90%; height: auto; padding: 1 2; background: $panel; border: thick $warning; }
    }
    """

    def __init__(self, run: str) -> None:
        super().__init__()
        self._run = run

    def compose(self) -> ComposeResult:
        """Ask."""
        text = (
            f"The circle {self._run} is being recorded. Quit all the same?\n\n"
            "What was recorded so far is kept, but the run has to be measured again. The machine is not stopped.\n\n"
            "Y  quit      N or Esc  go on"
        )
        with Vertical():
            yield Static(text, markup=False)

    def action_answer(self, answer: bool) -> None:  # noqa: FBT001 - called by a key's action string
        """Close with the answer."""
        self.dismiss(answer)
