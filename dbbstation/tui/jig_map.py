"""A small map of the jig plate with the ball's position."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content, Span

from dbbstation.tui.panel import Panel

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.service.board import Board

COLUMNS, ROWS = 13, 5

_LETTERS = 3
"""Width of a bore's number with the brackets that mark it."""


class JigMap(Panel):
    """Bores by number, X to the right and Y up; the run's bore is in inverted brackets."""

    def __init__(self, bores: Mapping[int, tuple[float, float]], *, id: str | None = None) -> None:  # noqa: A002 - Textual's name
        super().__init__(id=id)
        self._bores = bores
        self.styles.width, self.styles.height = COLUMNS, ROWS

    def text(self, board: Board) -> Content:
        return drawn(self._bores, None if board.announced is None else board.announced.ball.bore)


def drawn(bores: Mapping[int, tuple[float, float]], marked: int | None) -> Content:
    """Return a map of bores with one marked; empty without bores."""
    if not bores:
        return Content("")
    rows = [[" "] * COLUMNS for _ in range(ROWS)]
    span = None
    # The marked one last: where bores lie closer than letters, it is the one to be seen.
    for bore in sorted(bores, key=lambda number: number == marked):
        row, column = _cell(bores, bore)
        text = f"[{bore}]" if bore == marked else f" {bore} "
        if len(text) > _LETTERS:
            text = text.strip()
        rows[row][column : column + len(text)] = text
        if bore == marked:
            start = row * (COLUMNS + 1) + column
            span = Span(start, start + len(text), "reverse bold")
    return Content("\n".join("".join(row[:COLUMNS]) for row in rows), [span] if span else [])


def _cell(bores: Mapping[int, tuple[float, float]], bore: int) -> tuple[int, int]:
    x, y = bores[bore]
    xs, ys = [place[0] for place in bores.values()], [place[1] for place in bores.values()]
    reach = max(max(xs) - min(xs), max(ys) - min(ys)) or 1.0
    right = 0.5 + (x - (max(xs) + min(xs)) / 2.0) / reach
    up = 0.5 + (y - (max(ys) + min(ys)) / 2.0) / reach
    return round((1.0 - up) * (ROWS - 1)), round(right * (COLUMNS - _LETTERS))
