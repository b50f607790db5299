"""First figures of the last finished runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.station.events import RunCompleted
    from dbbstation.tui.board import Board

_NAME = 13


class FiguresPanel(Panel):
    """A table of two runs at most, so that both directions can be compared."""

    DEFAULT_CSS = "FiguresPanel { height: 3; }"

    def text(self, board: Board) -> Content:
        """Return titles and rows."""
        titles = f"{'figures [µm]':{_NAME}}{'centre':>8}{'mean':>8}{'circul.':>8}"
        rows = [Content(_row(result)) for result in board.results]
        empty = Content.styled("of the finished runs stand here", "dim")
        return lines(Content.styled(titles, "dim"), *(rows or [empty]))


def _row(completed: RunCompleted) -> str:
    figures = completed.figures
    name = f"{_short(completed.run.label):{_NAME}}"
    if figures is None:
        return f"{name}no circle"
    return f"{name}{figures.centre_deviation_um:8.1f}{figures.mean_radial_error_um:+8.1f}{figures.circularity_um:8.1f}"


def _short(label: str) -> str:
    """Return a run's name that fits; its end tells direction and repeat."""
    return label if len(label) < _NAME else f"…{label[2 - _NAME :]}"
