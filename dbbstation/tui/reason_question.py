"""Asks why an accepted run is withdrawn, or a faulty one counts."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from dbbstation.tui.texts import (
    ALL_THE_SAME,
    REASON_ANOTHER,
    REASON_KEYS,
    REASON_TITLE,
    REASON_TITLE_COUNTS,
    REASON_TYPED,
    REASONS,
)

if TYPE_CHECKING:
    from textual.app import ComposeResult
    from textual.binding import BindingType


class ReasonQuestion(ModalScreen[str | None]):
    """Returns the reason, or None for no change."""

    BINDINGS: ClassVar[list[BindingType]] = [
        *((str(number), f"because({number})", f"Reason {number}") for number in range(1, len(REASONS) + 2)),
        ("escape,ctrl+c", "dismiss", "Back"),
    ]

    def __init__(self, run: str, *, counts: bool = False) -> None:
        super().__init__()
        self._run_label = run
        self._reasons = ALL_THE_SAME if counts else REASONS
        self._title = REASON_TITLE_COUNTS if counts else REASON_TITLE

    def compose(self) -> ComposeResult:
        told = [*self._reasons, REASON_ANOTHER]
        reasons = "\n".join(f"{number}  {reason}" for number, reason in enumerate(told, start=1))
        with Vertical():
            yield Static(f"{self._title.format(run=self._run_label)}\n\n{reasons}\n\n{REASON_KEYS}", markup=False)
            yield Input(placeholder=REASON_TYPED, disabled=True)

    def action_because(self, number: int) -> None:
        if number <= len(self._reasons):
            self.dismiss(self._reasons[number - 1])
        elif number == len(self._reasons) + 1:
            self._type()

    def _type(self) -> None:
        field = self.query_one(Input)
        field.disabled = False
        field.add_class("-typing")
        field.focus()

    def on_input_submitted(self, submitted: Input.Submitted) -> None:
        if submitted.value.strip():
            self.dismiss(submitted.value.strip())
