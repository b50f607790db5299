"""Asked before an accepted run is taken back: why it does not count."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from dbbstation.tui.texts import REASON_KEYS, REASON_TITLE, REASON_TYPED, REASONS

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.binding import BindingType


class ReasonQuestion(ModalScreen[str | None]):
    """Returns the reason; None where the run counts as before.

    Args:
        run: name of the run.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        *((key, f"because('{key}')", reason) for key, reason in REASONS.items()),
        ("t", "type", "Type"),
        ("escape,ctrl+c", "dismiss", "Back"),
    ]

    def __init__(self, run: str) -> None:
        super().__init__()
        self._run_label = run

    def compose(self) -> ComposeResult:
        """Ask."""
        reasons = "\n".join(f"{key}  {reason}" for key, reason in REASONS.items())
        with Vertical():
            yield Static(f"{REASON_TITLE.format(run=self._run_label)}\n\n{reasons}\n\n{REASON_KEYS}", markup=False)
            yield Input(placeholder=REASON_TYPED, disabled=True)

    def action_because(self, key: str) -> None:
        """Close with a reason of the list."""
        self.dismiss(REASONS[key])

    def action_type(self) -> None:
        """Let the reason be typed."""
        field = self.query_one(Input)
        field.disabled = False
        field.add_class("-typing")
        field.focus()

    def on_input_submitted(self, submitted: Input.Submitted) -> None:
        """Close with what was typed; an empty line is no reason."""
        if submitted.value.strip():
            self.dismiss(submitted.value.strip())
