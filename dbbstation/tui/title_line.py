"""The top line: plan, run, state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.tui.panel import Panel
from dbbstation.tui.texts import VIRTUAL_BANNER

if TYPE_CHECKING:
    from dbbstation.service.board import Board


def banner(*, virtual: bool) -> Content:
    """Return the mark of a virtual machine for the top line."""
    return Content.styled(VIRTUAL_BANNER, "reverse bold $text-warning") if virtual else Content("")


class TitleLine(Panel):
    """One line over the whole width."""

    def __init__(self, plan: str, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._plan = plan

    def text(self, board: Board) -> Content:
        sign = banner(virtual=board.virtual)
        run: list[Content] = []
        if board.announced is not None and board.finished is None:
            run = [
                Content(f"run {board.announced.number} of {board.announced.count}"),
                Content.styled(board.announced.run.label, "bold"),
            ]
        state = Content(str(board.state) if board.state else "opening")
        # What stands at the end is the most important; where there is no room the plan's name is shortened first.
        room = (self.content_size.width or _NARROWEST) - len(sign) - 1
        rest = Content(" · ").join([*run, state])
        plan = _shortened(self._plan, room - len(rest) - len(" · "))
        if not plan and len(rest) > room:
            rest = Content(" · ").join([*run[1:], state])
        return sign + (Content.styled(f" {plan}", "bold") + Content(" · ") if plan else Content(" ")) + rest


_NARROWEST = 80
"""Assumed columns before the line has a size: those of the smallest terminal."""

_SHORTEST = 4
"""Least number of shown characters of a name."""


def _shortened(name: str, room: int) -> str:
    if len(name) <= room:
        return name
    return f"{name[: room - 1].rstrip()}…" if room >= _SHORTEST else ""
