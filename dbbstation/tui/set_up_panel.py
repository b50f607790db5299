"""The set-up of the announced run: bore, holder, ball, tilt, bar, feed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.content import Content

from dbbstation.tui.panel import Panel, lines

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle
    from dbbstation.station.events import RunAnnounced
    from dbbstation.tui.board import Board


class SetUpPanel(Panel):
    """Five rows."""

    DEFAULT_CSS = "SetUpPanel { height: 5; width: 1fr; }"

    def text(self, board: Board) -> Content:
        """Return what has to stand where."""
        announced = board.announced
        if announced is None:
            return Content("")
        ball, circle = announced.ball, announced.circle
        where = "no bore" if ball.bore is None else f"bore {ball.bore}"
        return lines(
            Content.assemble((where, "bold"), " ", _touch(announced)),
            Content.assemble("holder ", (ball.holder, "bold")),
            Content.assemble("ball ", (ball.name, "bold")),
            Content.assemble("tilt ", (_tilt(circle), "bold")),
            Content(f"bar {circle.bar_mm:g} mm {_elevation(circle)}"),
        )


def _touch(announced: RunAnnounced) -> Content:
    return Content.styled("put up", "$text-warning") if announced.put_up else Content.styled("leave as is", "dim")


def _tilt(circle: Circle) -> str:
    a, b, c = circle.tilt_deg
    return f"A {a:g}° B {b:g}°" + (f" C {c:g}°" if c else "")


def _elevation(circle: Circle) -> str:
    return f"raised {circle.elevation_deg:g}°" if circle.elevation_deg else "level"
