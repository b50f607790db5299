"""Instructions to the operator for a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dbbstation.plan.circle import Circle
    from dbbstation.plan.plan import Ball
    from dbbstation.plan.sampling import Sampling


def instructions(
    ball: Ball, circle: Circle, *, put_up: bool, program: str, sampling: Sampling | None = None
) -> tuple[str, ...]:
    """Return the steps in order, with a note if the instrument is too slow."""
    raised = f", raised by {circle.elevation_deg:g}°" if circle.elevation_deg else ", level"
    what = f"NC program {program}" if program else f"{circle.direction} circle"
    return (
        *(_mounted if ball.place_known else _under_spindle)(ball, circle, put_up=put_up),
        f"Bar of {circle.bar_mm:g} mm{raised}; circle about {_place(circle.centre_mm)}",
        f"Start the {what} at {circle.feed_mm_min:g} mm/min",
        *(() if sampling is None or sampling.enough else (too_slow(sampling),)),
    )


def too_slow(sampling: Sampling) -> str:
    """Return the figures that are not resolved by so few points."""
    points = f"The instrument brings {sampling.points_per_turn:.0f} points per turn"
    if not sampling.is_circle:
        return f"{points}, which is no circle: take a lower feed"
    return f"{points}: undulations above {sampling.highest_undulation} per revolution are not seen"


def _mounted(ball: Ball, circle: Circle, *, put_up: bool) -> tuple[str, ...]:
    step = _mount(ball) if put_up else f"Leave the ball {ball.name} where it stands, do not touch its holder"
    return (step, _tilt(circle))


def _under_spindle(ball: Ball, circle: Circle, *, put_up: bool) -> tuple[str, ...]:
    """Return the steps of the standard circular test [CAL III-A], beginning with the move to the circle's centre and tilt."""
    if not put_up:
        return (f"Leave the ball {ball.name} and the moving ball as they stand, do not touch them", _tilt(circle))
    a, b, c = circle.tilt_deg
    pose = f"{_place(ball.centre_mm)} A {a:g}° B {b:g}°" + (f" C {c:g}°" if c else "")
    return (
        f"Drive the machine to {pose} and put the ball {ball.name} up under the spindle",
        "With a micrometer: read now how far both balls are from the tool tip, and note it for the session file",
    )


def _tilt(circle: Circle) -> str:
    a, b, c = circle.tilt_deg
    turn = f" and turn it C {c:g}°" if c else ""
    return f"Tilt the tool to A {a:g}°, B {b:g}°{turn}"


def _place(point_mm: tuple[float, float, float]) -> str:
    x, y, z = point_mm
    return f"X {x:.3f} Y {y:.3f} Z {z:.3f}"


def _mount(ball: Ball) -> str:
    if ball.bore is None:
        return f"Set up the ball {ball.name} ({ball.holder}); it stands in no bore"
    return f"Put the {ball.holder} holder with the ball {ball.name} into bore {ball.bore}"
