"""The line that states the next action."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.quality.answer import Advice
from dbbstation.station.states import RECORDING, State
from dbbstation.tui.panel import Panel
from dbbstation.tui.sentences import now, now_for_operator

if TYPE_CHECKING:
    from collections.abc import Callable

    from dbbstation.service.board import Board

_ASKING = {State.ANNOUNCED, State.ARMED, State.COMPLETE, State.PAUSED}
"""States in which the station waits for a person."""


class NowLine(Panel):
    """One sentence; the line grows for a fault."""

    can_grow = True
    _say: Callable[[Board], str] = staticmethod(now)

    def text(self, board: Board) -> Content:
        return Content(self._say(board))

    def show(self, board: Board) -> None:
        """Show the sentence, coloured if it asks for something."""
        super().show(board)
        wrong = (
            board.state is State.COMPLETE
            and board.completed is not None
            and (board.completed.answer.word is Advice.REPEAT or bool(board.doubted))
        )
        self.set_class(board.fault is not None or board.state is State.FLAWED or wrong, "-fault")
        self.set_class(board.fault is None and board.state in _ASKING and not wrong, "-asking")
        self.set_class(board.state in RECORDING, "-running")


class OperatorNowLine(NowLine):
    """`NowLine` for an operator."""

    def __init__(self, trouble: str, *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._say = partial(now_for_operator, trouble=trouble)
