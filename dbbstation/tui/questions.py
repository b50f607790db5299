"""Questions with a choice from a list, a typed answer, or yes or no."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, TypeVar

from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from dbbstation.service.session_notes import shop_degc
from dbbstation.tui import texts
from dbbstation.tui.row_screen import mark_chosen

if TYPE_CHECKING:
    from collections.abc import Sequence

    from textual.app import ComposeResult
    from textual.binding import BindingType
    from textual.widget import Widget

_Answer = TypeVar("_Answer")


class _Question(ModalScreen[_Answer]):
    """A text, and what is answered with beneath it."""

    def __init__(self, text: str, *beneath: Widget) -> None:
        super().__init__()
        self._text, self._beneath = text, beneath

    def compose(self) -> ComposeResult:
        with Vertical():
            yield Static(self._text, markup=False)
            yield from self._beneath


class ChooseQuestion(_Question[int | None]):
    """Returns the index of the choice, or None."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,q,ctrl+c", "dismiss(None)", "Back")]

    def __init__(self, title: str, labels: Sequence[str], at: int = 0) -> None:
        self._rows, self._at = [Content(label) for label in labels], at
        super().__init__(title, OptionList(*(Option(row) for row in self._rows)))

    def on_mount(self) -> None:
        options = self.query_one(OptionList)
        options.highlighted = min(max(self._at, 0), len(self._rows) - 1) if self._rows else None
        mark_chosen(options, self._rows)
        options.focus()

    def on_option_list_option_highlighted(self) -> None:
        mark_chosen(self.query_one(OptionList), self._rows)

    def on_option_list_option_selected(self, chosen: OptionList.OptionSelected) -> None:
        self.dismiss(chosen.option_index)


class TypeQuestion(_Question[str | None]):
    """Returns the stripped text, or None."""

    BINDINGS: ClassVar[list[BindingType]] = [("escape,ctrl+c", "dismiss(None)", "Back")]

    def __init__(self, title: str, text: str = "") -> None:
        super().__init__(title, Input(value=text, placeholder="type it, then Enter; Esc goes back"))

    def on_input_submitted(self, submitted: Input.Submitted) -> None:
        self.dismiss(submitted.value.strip())


class TemperatureQuestion(TypeQuestion):
    """Returns a valid temperature as text, an empty text to continue without one, or None to go back."""

    def __init__(self) -> None:
        super().__init__(texts.TEMPERATURE_NOW)

    def on_input_submitted(self, submitted: Input.Submitted) -> None:
        submitted.prevent_default()
        text = submitted.value.strip()
        if not text or shop_degc(text) is not None:
            self.dismiss(text)
        else:
            self.query_one(Static).update(f"{texts.NO_NUMBER.format(text=text)} {texts.TEMPERATURE_NOW}")


class ReasonQuestion(_Question[str | None]):
    """Returns the reason, or None for no change."""

    BINDINGS: ClassVar[list[BindingType]] = [
        *((str(number), f"because({number})", f"Reason {number}") for number in range(1, len(texts.REASONS) + 2)),
        ("escape,ctrl+c", "dismiss", "Back"),
    ]

    def __init__(self, run: str, *, counts: bool = False) -> None:
        self._reasons = texts.ALL_THE_SAME if counts else texts.REASONS
        wrong = f"Something is wrong with {run}. Why does it count all the same?"
        title = wrong if counts else f"Why does {run} not count?"
        told = [*self._reasons, "type another reason"]
        reasons = "\n".join(f"{number}  {reason}" for number, reason in enumerate(told, start=1))
        typed = Input(placeholder="type the reason, then Enter", disabled=True)
        super().__init__(f"{title}\n\n{reasons}\n\nEsc  leaves it as it is", typed)

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


class YesQuestion(_Question[bool]):
    """Returns whether the answer is yes."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("y", "answer(True)", "Yes"),
        ("n,escape,ctrl+c,q", "answer(False)", "Go on"),
    ]

    def action_answer(self, answer: bool) -> None:  # noqa: FBT001 - called by a key's action string
        self.dismiss(answer)


class GiveUpQuestion(YesQuestion):
    """Returns whether to end the run."""

    def __init__(self, run: str, act: str) -> None:
        super().__init__(
            f"The circle {run} is being recorded. {act} all the same?\n\n"
            "What was recorded so far is kept, but the run has to be measured again. The machine is not stopped.\n\n"
            f"Y  {act.lower()}      N or Esc  go on"
        )
        self.run = run
