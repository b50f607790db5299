"""A test plan: balls, circles and known places, and tests chosen by name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dbbstation.errors import StationError
from dbbstation.machine.travel import check_travel

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.circle import Circle, Direction


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

    def check(self, machine: Machine) -> None:
        """Check every circle with feed-in and feed-out against the travel.

        Raises:
            TravelError: names test, direction, pose and limit.
        """
        for test in self.tests.values():
            for direction in test.directions:
                check_travel(machine, test.run(direction).envelope(), where=f"test {test.name} {direction}")


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
