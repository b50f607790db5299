"""All steps of the set-up, on a tall screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.station.states import State
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.service.board import Board


class StepsPanel(Panel):
    """One step in a row or two; finished ones are dim."""

    can_grow = True

    def text(self, board: Board) -> Content:
        if board.announced is None or board.finished is not None:
            return Content("")
        steps = board.announced.instructions
        ready = {State.ANNOUNCED: 0, State.ARMED: len(steps) - 1}.get(board.state or State.BETWEEN, len(steps))
        return lines(
            *(
                Content.styled(f"{number + 1} {step}", "dim" if number < ready else "")
                for number, step in enumerate(steps)
            )
        )
