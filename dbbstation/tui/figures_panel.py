"""First figures of the last finished runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.service.board import Verdict
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.service.board import Board
    from dbbstation.station.events import RunCompleted

_NAME = 13


class FiguresPanel(Panel):
    """A table of two runs at most, so that both directions can be compared."""

    DEFAULT_CSS = "FiguresPanel { height: 3; }"

    def text(self, board: Board) -> Content:
        """Return titles and rows."""
        titles = f"{'figures [µm]':{_NAME}}{'centre':>8}{'mean':>8}{'circul.':>8}"
        rows = [_row(result, board.verdicts.get(result.run.label, Verdict.NONE)) for result in board.results]
        empty = Content.styled("of the finished runs stand here", "dim")
        return lines(Content.styled(titles, "dim"), *(rows or [empty]))


def _row(completed: RunCompleted, verdict: Verdict) -> Content:
    figures = completed.figures
    name = f"{_short(completed.run.label):{_NAME}}"
    if figures is None:
        return Content(f"{name}no circle")
    row = f"{name}{figures.centre_deviation_um:8.1f}{figures.mean_radial_error_um:+8.1f}{figures.circularity_um:8.1f}"
    return Content.styled(f"{row} x", "dim strike") if verdict is Verdict.REJECTED else Content(row)


def _short(label: str) -> str:
    """Return a run's name that fits; its end tells direction and repeat."""
    return label if len(label) < _NAME else f"…{label[2 - _NAME :]}"
