"""The announced run's set-up: position, ball, tilt, bar, and on a tall screen its steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.station.states import State
from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle
    from dbbstation.plan.plan import Ball
    from dbbstation.service.board import Board
    from dbbstation.station.events import RunAnnounced


class SetUpPanel(Panel):
    """Five rows."""

    def text(self, board: Board) -> Content:
        announced = board.announced
        if announced is None:
            return Content("")
        ball, circle = announced.ball, announced.circle
        where, what, on = _place(ball)
        return lines(
            Content.assemble((where, "bold"), " ", _touch(announced)),
            Content.assemble(what, " ", (on, "bold")),
            Content.assemble("ball ", (ball.name, "bold")),
            Content.assemble("tilt ", (_tilt(circle), "bold")),
            Content.assemble(f"bar {circle.bar_mm:g} mm {_elevation(circle)}", _too_slow(announced)),
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


def _touch(announced: RunAnnounced) -> Content:
    return Content.styled("put up", "$text-warning") if announced.put_up else Content.styled("leave as is", "dim")


def _tilt(circle: Circle) -> str:
    a, b, c = circle.tilt_deg
    return f"A {a:g}° B {b:g}°" + (f" C {c:g}°" if c else "")


def _elevation(circle: Circle) -> str:
    return f"raised {circle.elevation_deg:g}°" if circle.elevation_deg else "level"
