"""What a person has to do for a run, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle
    from dbbstation.plan.plan import Ball


def instructions(ball: Ball, circle: Circle, *, put_up: bool, program: str) -> tuple[str, ...]:
    """Return the steps, in their order."""
    a, b, c = circle.tilt_deg
    x, y, z = circle.centre_mm
    raised = f", raised by {circle.elevation_deg:g}°" if circle.elevation_deg else ", level"
    what = f"NC program {program}" if program else f"{circle.direction} circle"
    turn = f" and turn it C {c:g}°" if c else ""
    return (
        _mount(ball) if put_up else f"Leave the ball {ball.name} where it stands, do not touch its holder",
        f"Tilt the tool to A {a:g}°, B {b:g}°{turn}",
        f"Bar of {circle.bar_mm:g} mm{raised}; circle about X {x:.3f} Y {y:.3f} Z {z:.3f}",
        f"Start the {what} at {circle.feed_mm_min:g} mm/min",
    )


def _mount(ball: Ball) -> str:
    if ball.bore is None:
        return f"Set up the ball {ball.name} ({ball.holder}); it stands in no bore"
    return f"Put the {ball.holder} holder with the ball {ball.name} into bore {ball.bore}"
