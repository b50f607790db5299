"""The announced run's set-up: position, ball, tilt, bar, and on a tall screen its steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.containers import Horizontal
from textual.content import Content, Span

from dbbstation.station.sequencer import tilt_words
from dbbstation.station.states import State
from dbbstation.tui.panel import Panel, lines
from dbbstation.tui.reading_panel import ReadingPanel

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from textual.app import ComposeResult

    from dbbstation.plan.plan import Ball
    from dbbstation.service.board import Board
    from dbbstation.station.events import RunAnnounced

COLUMNS, ROWS = 13, 5

_LETTERS = 3
"""Width of a bore's number with the brackets that mark it."""


class JigMap(Panel):
    """Bores by number, X to the right and Y up; the run's bore is in inverted brackets."""

    def __init__(self, bores: Mapping[int, tuple[float, float]]) -> None:
        super().__init__(id="map")
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


class SetUpPanel(Panel):
    """Five rows."""

    def text(self, board: Board) -> Content:
        announced = board.announced
        if announced is None:
            return Content("")
        ball, circle = announced.ball, announced.circle
        where, what, on = _place(ball)
        raised = f"raised {circle.elevation_deg:g}°" if circle.elevation_deg else "level"
        return lines(
            Content.assemble(
                (where, "bold"), " ", ("put up", "$text-warning") if announced.put_up else ("leave as is", "dim")
            ),
            Content.assemble(what, " ", (on, "bold")),
            Content.assemble("ball ", (ball.name, "bold")),
            Content.assemble("tilt ", (tilt_words(circle), "bold")),
            Content.assemble(f"bar {circle.bar_mm:g} mm {raised}", _too_slow(announced)),
        )


class StepsPanel(Panel):
    """One step per row or two; finished steps are dim."""

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


def set_up(bores: Mapping[int, tuple[float, float]], clock: Callable[[], float]) -> ComposeResult:
    """Yield the reading and all panels of a run's set-up."""
    yield ReadingPanel(clock=clock)
    with Horizontal(id="table"):
        yield SetUpPanel(id="set-up")
        yield JigMap(bores)
    yield StepsPanel(id="steps")


def _place(ball: Ball) -> tuple[str, str, str]:
    if not ball.place_known:
        x, y, z = ball.centre_mm
        return "under spindle", "at", f"X {x:g} Y {y:g} Z {z:g}"
    return "no bore" if ball.bore is None else f"bore {ball.bore}", "holder", ball.holder


def _too_slow(announced: RunAnnounced) -> Content:
    seen = announced.sampling
    if seen is None or seen.enough:
        return Content("")
    return Content.styled(f", only {seen.points_per_turn:.0f} points per turn", "$text-warning")
