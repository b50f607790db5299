"""First figures of the last finished runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.service.board import RunDecision
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.service.board import Board
    from dbbstation.station.events import RunCompleted

_NAME = 12

_WIDE = 46
"""From so many columns on X and Y of the centre stand beside its distance."""

_DISTANCE, _MEAN = (8, 7), (7, 6)
"""Columns of a centre's distance and of a mean: with room to spare, and beside X and Y."""


class FiguresPanel(Panel):
    """A table of at most two runs, for both directions."""

    def text(self, board: Board) -> Content:
        wide = self.content_size.width >= _WIDE
        centre = f"{'X':>7}{'Y':>7}" if wide else ""
        titles = f"{'figures [µm]':{_NAME}}{centre}{'centre':>{_DISTANCE[wide]}}{'mean':>{_MEAN[wide]}}{'circul.':>8}"
        rows = [
            _row(result, board.verdicts.get(result.run.label, RunDecision.NONE), wide=wide) for result in board.results
        ]
        empty = Content.styled("of the finished runs stand here", "dim")
        return lines(Content.styled(titles, "dim"), *(rows or [empty]))


def _row(completed: RunCompleted, verdict: RunDecision, *, wide: bool) -> Content:
    figures = completed.figures
    rejected = verdict is RunDecision.REJECTED
    name = f"{_short(f'x {completed.run.label}' if rejected else completed.run.label):{_NAME}}"
    if figures is None:
        return Content(f"{name}no circle")
    centre = "".join(f"{1e3 * part:+7.1f}" for part in figures.centre_mm) if wide else ""
    sizes = f"{figures.centre_deviation_um:{_DISTANCE[wide]}.1f}{figures.mean_radial_error_um:+{_MEAN[wide]}.1f}{figures.circularity_um:8.1f}"
    row = f"{name}{centre}{sizes}"
    return Content.styled(row, "dim strike") if rejected else Content(row)


def _short(label: str) -> str:
    if len(label) < _NAME:
        return label
    sign = "x " if label.startswith("x ") else ""
    return f"{sign}…{label[2 + len(sign) - _NAME :]}"
