"""Lines over the whole width: plan and state, the next action, the progress."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.quality.answer import Advice
from dbbstation.station.states import RECORDING, State
from dbbstation.tui.panel import Panel
from dbbstation.tui.sentences import now, now_for_operator
from dbbstation.tui.texts import VIRTUAL_BANNER

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

    def __init__(self, trouble: str) -> None:
        super().__init__(id="now")
        self._say = partial(now_for_operator, trouble=trouble)


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
        # The end of the line is the most important part. A narrow screen shortens the plan's name first.
        room = (self.content_size.width or _NARROWEST) - len(sign) - 1
        rest = Content(" · ").join([*run, state])
        plan = _shortened(self._plan, room - len(rest) - len(" · "))
        if not plan and len(rest) > room:
            rest = Content(" · ").join([*run[1:], state])
        return sign + (Content.styled(f" {plan}", "bold") + Content(" · ") if plan else Content(" ")) + rest


_NARROWEST = 80
"""Assumed columns before the line has a size: those of the smallest terminal."""

_SHORTEST_NAME = 4
"""Least number of shown characters of a name."""


def _shortened(name: str, room: int) -> str:
    if len(name) <= room:
        return name
    return f"{name[: room - 1].rstrip()}…" if room >= _SHORTEST_NAME else ""
