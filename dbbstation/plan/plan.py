"""A test plan: balls, circles and known places, and tests chosen by name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import StationError
from dbbstation.facts.quantities import FULL_TURN_DEG
from dbbstation.machine.travel import check_travel

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.computing.arrays import Floats
    from dbbstation.machine.geometry import Machine


class Direction(StrEnum):
    """Sense of travel, seen from +Z."""

    CCW = "ccw"
    CW = "cw"

    @property
    def sign(self) -> float:
        """Return +1 for rising angles, -1 for falling."""
        return 1.0 if self is Direction.CCW else -1.0


@dataclass(frozen=True)
class Circle:
    """A horizontal circle of the tool tip about a fixed ball, with a level or raised bar.

    A bar raised by e gives the radius R cos e, at the height R sin e above the ball.

    Attributes:
        ball_mm: planned place of the fixed ball, machine frame (x, y, z).
        centre_mm: as programmed, machine frame (x, y, z).
        bar_mm: nominal ball distance R.
        tilt_deg: constant (A, B, C).
        start_deg: of the full turn, from +X towards +Y.
        feed_in_mm: length of the radial move onto the circle.
    """

    ball_mm: tuple[float, float, float]
    centre_mm: tuple[float, float, float]
    bar_mm: float
    tilt_deg: tuple[float, float, float]
    feed_mm_min: float
    start_deg: float
    overshoot_deg: float
    feed_in_mm: float
    elevation_deg: float
    direction: Direction

    @property
    def radius_mm(self) -> float:
        """Return the path's radius, R cos e [mm]."""
        return self.bar_mm * float(np.cos(np.radians(self.elevation_deg)))

    @property
    def turning_deg_s(self) -> float:
        """Return the angular speed, always positive [deg/s]."""
        return float(np.degrees(self.feed_mm_min / 60.0 / self.radius_mm))

    @property
    def feeding_s(self) -> float:
        """Return the time of feed-in or feed-out at the planned feed [s]."""
        return self.feed_in_mm / (self.feed_mm_min / 60.0)

    @property
    def swept_deg(self) -> float:
        """Return the arc between feed-in and feed-out [deg]."""
        return FULL_TURN_DEG + 2.0 * self.overshoot_deg

    @property
    def swept_s(self) -> float:
        """Return the time on the circle, overshoots included [s]."""
        return self.swept_deg / self.turning_deg_s

    def theta_deg(self, phi_deg: Floats) -> Floats:
        """Return the angle from +X towards +Y at progress `phi_deg`, 0 at the start [deg]."""
        return self.start_deg + self.direction.sign * phi_deg

    def phi_deg(self, theta_deg: Floats) -> Floats:
        """Return progress at an angle, 0 to 360 [deg], the inverse of `theta_deg`."""
        return np.mod(self.direction.sign * (theta_deg - self.start_deg), FULL_TURN_DEG)

    def poses(self, theta_deg: Floats, outside_mm: float = 0.0) -> Floats:
        """Return commanded poses at angles, shape (n, 6) [mm, deg]."""
        theta, elevation = np.radians(theta_deg), np.radians(self.elevation_deg)
        radius = self.radius_mm + outside_mm * np.cos(elevation)
        x, y, z = self.centre_mm
        height = np.full_like(theta, z + outside_mm * np.sin(elevation))
        tilt = np.broadcast_to(self.tilt_deg, (len(theta), 3))
        return np.column_stack([x + radius * np.cos(theta), y + radius * np.sin(theta), height, tilt])

    def envelope(self, step_deg: float = 1.0) -> Floats:
        """Return poses of the whole path, feed-in and feed-out included, shape (n, 6) [mm, deg]."""
        count = int(np.ceil(self.swept_deg / step_deg)) + 1
        arc = self.poses(self.theta_deg(np.linspace(-self.overshoot_deg, FULL_TURN_DEG + self.overshoot_deg, count)))
        ends = self.theta_deg(np.array([-self.overshoot_deg, FULL_TURN_DEG + self.overshoot_deg]))
        outside = self.poses(ends, self.feed_in_mm)
        return np.vstack([outside[:1], arc, outside[1:]])


def circle_s(circle: Circle) -> float:
    """Return the time of feed-in, turn, overshoots and feed-out, without dwells and ramps [s]."""
    return circle.swept_s + 2.0 * circle.feeding_s


def circles_s(circles: Iterable[Circle]) -> float:
    """Return the time of several circles, without set-ups [s]."""
    return sum(circle_s(circle) for circle in circles)


LARGEST_LOSS_PERCENT = 0.5
"""Share of a run's samples that may be lost if the plan sets no limit [%].

A sound line loses no samples; noise on the cable loses single ones, hundredths of a percent. The centre is a mean over
the turn: a contiguous missing share p moves it by at most 2 p times the form's amplitude. That is 0.2 µm at 0.5 % and a
form of ± 20 µm, less than a reading's noise. At 5 % it would be 2 µm, the uncertainty of a ball's place. Larger losses
also indicate an overloaded computer, whose times, and thus angles, are doubtful."""


@dataclass(frozen=True)
class Plate:
    """The jig plate that carries the balls.

    Attributes:
        expansion_um_m_k: [µm/(m K)]; None if not noted.
    """

    origin_mm: tuple[float, float, float]
    expansion_um_m_k: float | None = None


@dataclass(frozen=True)
class Ball:
    """A ball, measured by a CMM or set up under the spindle.

    Attributes:
        bore: None if not in a bore.
        centre_mm: machine frame (x, y, z).
        repeatability_mm: of the holder, one standard deviation per axis.
        place_known: False for a ball set up under the spindle [CAL III-A]; `centre_mm` is then the commanded place.
        plate: None without bore.
        form_um: roundness deviation by its certificate; None if not stated.
    """

    name: str
    bore: int | None
    holder: str
    centre_mm: tuple[float, float, float]
    uncertainty_mm: float
    repeatability_mm: float
    place_known: bool = True
    plate: Plate | None = None
    form_um: float | None = None


@dataclass(frozen=True)
class PlannedTest:
    """One test: a ball and the circle about it, run in one or both directions."""

    name: str
    ball: Ball
    circle: Circle
    directions: tuple[Direction, ...]

    def run(self, direction: Direction) -> Circle:
        """Return the circle of one run."""
        return replace(self.circle, direction=direction)


@dataclass(frozen=True)
class Plan:
    """Tests by name, in order.

    Attributes:
        repeat_at_end: tests measured again at the end, to separate drift and height.
    """

    name: str
    tests: Mapping[str, PlannedTest]
    repeat_at_end: tuple[str, ...] = ()
    largest_loss_percent: float = LARGEST_LOSS_PERCENT

    def runs(self, tests: Iterable[str] = ()) -> dict[tuple[str, Direction], Circle]:
        """Return the circle of every test, or of the named ones, in each of its directions."""
        chosen = [self.tests[name] for name in tests or self.tests]
        return {(test.name, direction): test.run(direction) for test in chosen for direction in test.directions}

    def check(self, machine: Machine) -> None:
        """Check every circle with feed-in and feed-out against the travel.

        Raises:
            TravelError: names test, direction, pose and limit.
        """
        for (name, direction), circle in self.runs().items():
            check_travel(machine, circle.envelope(), where=f"test {name} {direction}")


def chosen_of(plan: str, known: Iterable[str], tests: Sequence[str], exclude: Sequence[str]) -> list[str]:
    """Return the named tests in their order, or all tests, without the excluded ones.

    Raises:
        StationError: an unknown name, or no test is left.
    """
    names = list(known)
    unknown = [name for name in (*tests, *exclude) if name not in names]
    if unknown:
        raise StationError(
            f"the plan has no test {', '.join(unknown)}", where=plan, remedy=f"it has {', '.join(names)}"
        )
    chosen = [name for name in tests or names if name not in exclude]
    if not chosen:
        raise StationError("no test is left", where=plan, remedy="exclude fewer")
    return chosen
