"""Progress of circle and plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.station.states import RECORDING, State
from dbbstation.tui.panel import Panel

if TYPE_CHECKING:
    from dbbstation.service.board import Board

_FIXED = 60
"""Number of characters beside the two bars."""

_SHORTEST = 6


class ProgressLine(Panel):
    """Two bars with numbers in one line."""

    def text(self, board: Board) -> Content:
        length = max((self.size.width - _FIXED) // 2, _SHORTEST)
        count = len(board.tasks)
        done = board.accepted / count if count else 0.0
        return Content.assemble(
            _circle(board, length), "   plan ", *_bar(done, length), f" {board.accepted} of {count} accepted"
        )


def _circle(board: Board, length: int) -> Content:
    announced = board.announced
    if announced is None or board.state not in RECORDING:
        return Content.assemble("circle ", *_bar(0.0, length), f" {'not running':22}")
    circle = announced.circle
    swept = circle.swept_deg if board.state is State.LEAVING else board.swept_deg
    left_s = max(circle.swept_deg - swept, 0.0) / circle.turning_deg_s
    text = f" {swept:3.0f}° of {circle.swept_deg:3.0f}°, {left_s:3.0f} s left"
    return Content.assemble("circle ", *_bar(swept / circle.swept_deg, length), f"{text:23}")


def _bar(share: float, length: int) -> tuple[Content, Content]:
    full = round(min(max(share, 0.0), 1.0) * length)
    return Content.styled("━" * full, "bold $text-primary"), Content.styled("─" * (length - full), "dim")
