"""Screens with a help text, and the screen with a sentence and rows chosen by arrow keys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from textual.containers import VerticalScroll
from textual.content import Content
from textual.screen import Screen
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from dbbstation.service.session_notes import shop_degc
from dbbstation.tui import texts
from dbbstation.tui.footer import KeyFooter
from dbbstation.tui.help_screen import HELP
from dbbstation.tui.now_line import banner

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from textual.app import ComposeResult

    from dbbstation.service.choice import Choice, Prepared
    from dbbstation.service.front import Front
    from dbbstation.tui.app import StationApp


class ExplainedScreen(Screen[None]):
    """A screen that F1 explains."""

    help_name: ClassVar[str] = ""
    """Name of its text in the help."""

    _keys_by: object = None

    def keys_by(self, now: object) -> None:
        """Show the keys again if what they depend on has changed."""
        if now != self._keys_by:
            self._keys_by = now
            self.refresh_bindings()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Ask the method `offers_ACTION` whether the action is possible now, if there is one."""
        offers: Callable[..., bool] | None = getattr(self, f"offers_{action}", None)
        return super().check_action(action, parameters) if offers is None else offers(*parameters)

    def look(self) -> None:
        """Show changes from other parts of the program."""


CURSOR = "▸ "
"""Text before the chosen row."""


def mark_chosen(options: OptionList, rows: Sequence[Content]) -> None:
    """Show rows with the mark before the chosen row."""
    for place, row in enumerate(rows[: options.option_count]):
        mark = CURSOR if place == options.highlighted else " " * len(CURSOR)
        options.replace_option_prompt_at_index(place, Content(mark) + row)


class RowScreen(ExplainedScreen):
    """A screen with title, sentence, rows, a text about the chosen row, and keys."""

    def __init__(self) -> None:
        super().__init__()
        self._put: list[Content] = []

    def compose(self) -> ComposeResult:
        yield Static(Content(f" dbbstation · {HELP[self.help_name].title}"), id="row-title")
        yield Static("", id="row-now", markup=False)
        yield OptionList(id="rows")
        with VerticalScroll(id="row-about", can_focus=False):
            yield Static("", id="row-text", markup=False)
        yield KeyFooter()

    def say(self, text: str, *, wrong: bool = False) -> None:
        if not self.stands:
            return
        now = self.query_one("#row-now", Static)
        now.update(Content(text))
        now.set_class(wrong, "-wrong")

    def failed(self, error: Exception) -> None:
        self.say(str(error), wrong=True)

    def banner(self, *, virtual: bool) -> None:
        """Show the title, marked if the machine is virtual."""
        if self.stands:
            title = Content(f" dbbstation · {HELP[self.help_name].title}")
            self.query_one("#row-title", Static).update(banner(virtual=virtual) + title)

    def about(self, text: Content) -> None:
        if not self.stands:
            return
        self.query_one("#row-text", Static).update(text)

    @property
    def stands(self) -> bool:
        """Return whether the screen's parts exist; background work may end earlier or later."""
        return bool(self.query("#row-text"))

    @property
    def at(self) -> int:
        return self.query_one("#rows", OptionList).highlighted or 0

    def put(self, rows: Sequence[Content]) -> None:
        if not self.stands:
            return
        options = self.query_one("#rows", OptionList)
        self._put = list(rows)
        if len(rows) == options.option_count:
            self._mark()
            return
        at = options.highlighted or 0
        options.clear_options()
        options.add_options([Option(row) for row in rows])
        options.highlighted = min(at, len(rows) - 1) if rows else None
        self._mark()
        options.focus()

    def on_option_list_option_highlighted(self) -> None:
        self._mark()
        self.chosen_another()

    def chosen_another(self) -> None:
        """React to another chosen row."""

    def _mark(self) -> None:
        mark_chosen(self.query_one("#rows", OptionList), self._put)


class FrontScreen(RowScreen):
    """A list of rows before a session is opened."""

    def __init__(self, reception: StationApp, front: Front) -> None:
        super().__init__()
        self._reception, self._front = reception, front

    def do(self, work: Callable[[], Any], then: Callable[[Any], None]) -> None:
        """Do work in the background, then go on with its result or say why not."""
        self._reception.do(work, then, self.failed)

    def prepare(self, choice: Choice, then: Callable[[Prepared], None]) -> None:
        """Read and check what was chosen."""
        self.say(texts.NEW_CHECKS)
        self.do(lambda: self._front.prepare(choice), then)

    def degc_of(self, text: str) -> float | None:
        """Return a temperature, or say that it is none."""
        degc = shop_degc(text)
        if degc is None:
            self.say(texts.NO_NUMBER.format(text=text), wrong=True)
        return degc
