"""Control characters in what is shown do not reach the terminal, whichever way a text comes onto the screen."""

from __future__ import annotations

import asyncio

from rich.text import Text
from textual.app import App
from textual.content import Content
from textual.widgets import DataTable, Label, Static

from dbbstation.tui.plain_terminal import show_controls

TITLE = "name\x1b]0;owned\x07\x9b31m\u202e"


class _Shows(App[None]):
    def compose(self):
        yield Static(TITLE)
        yield Label(Content(TITLE))
        yield Static(Text(TITLE))
        yield Static(Content.from_markup("[b]$name[/b]", name=TITLE))
        yield DataTable()

    def on_mount(self) -> None:
        table = self.query_one(DataTable)
        table.add_column(Text(TITLE))
        table.add_row(TITLE)


async def _shown() -> list[str]:
    app = _Shows()
    async with app.run_test(size=(80, 12)) as pilot:
        await pilot.pause()
        strips = app.screen._compositor.render_strips()
        return ["".join(segment.text for segment in strip) for strip in strips]


def test_no_text_on_the_screen_gives_orders():
    show_controls()
    lines = asyncio.run(_shown())
    assert sum(r"name\x1b]0;owned\x07\x9b31m\u202e" in line for line in lines) >= 5
    assert not set("\x1b\x07\x9b\u202e") & set("".join(lines))
