"""A test plan: which balls stand where, which circles are run about them, how well their places are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from dbbstation.machine.travel import check_travel

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.machine.geometry import Machine
    from dbbstation.plan.circle import Circle, Direction

LARGEST_LOSS_PERCENT = 0.5
"""Share of a run's samples that may be lost where the plan sets no limit [%].

A line that works loses none; noise on the cable costs single ones, hundredths of a percent. The centre is a mean over
the turn, so a share p that is missing in one piece moves it by no more than 2 p times the amplitude of the form: 0.2 µm
at 0.5 % and a form of ± 20 µm, less than the noise of a reading. At 5 % it would be 2 µm, as much as a ball's place is
known to. More than the limit also says that the computer does not keep up, and then times, which give the angles, are
in doubt."""


@dataclass(frozen=True)
class Plate:
    """The jig plate that balls stand on.

    Attributes:
        origin_mm: where the origin of its frame stands, machine frame (x, y, z) [mm].
        expansion_um_m_k: thermal expansion [µm/(m K)]; None where not noted.
    """

    origin_mm: tuple[float, float, float]
    expansion_um_m_k: float | None = None


@dataclass(frozen=True)
class Ball:
    """A ball on the table, as the coordinate measuring machine (CMM) knows it, or put up under the spindle.

    Attributes:
        name: its key in the plan.
        bore: bore of the jig plate it stands in; None where it stands in no bore.
        centre_mm: centre in the machine frame (x, y, z) [mm].
        repeatability_mm: of putting the holder up, one standard deviation per axis [mm].
        place_known: False for a ball that is put up under the spindle, as the standard circular test does [CAL III-A];
            `centre_mm` is then where the machine is told to stand.
        plate: that its bore is in; None where it stands in no bore.
    """

    name: str
    bore: int | None
    holder: str
    centre_mm: tuple[float, float, float]
    uncertainty_mm: float
    repeatability_mm: float
    place_known: bool = True
    plate: Plate | None = None


@dataclass(frozen=True)
class PlannedTest:
    """One test: a ball and the circle about it, run in one or both directions.

    Attributes:
        name: unique in the plan.
        directions: senses of travel, in the order they are run.
    """

    name: str
    ball: Ball
    circle: Circle
    directions: tuple[Direction, ...]

    def run(self, direction: Direction) -> Circle:
        """Return the circle of one run."""
        return replace(self.circle, direction=direction)


@dataclass(frozen=True)
class Plan:
    """Tests by name, in the order they are run.

    Attributes:
        repeat_at_end: tests measured a second time after all others, so that drift and height do not mix.
        largest_loss_percent: share of a run's samples that may be lost [%].
    """

    name: str
    tests: Mapping[str, PlannedTest]
    repeat_at_end: tuple[str, ...] = ()
    largest_loss_percent: float = LARGEST_LOSS_PERCENT

    def check(self, machine: Machine) -> None:
        """Dry-run every circle, feed-in and feed-out included, against the machine's travel.

        Raises:
            TravelError: names test, direction, pose and limit.
        """
        for test in self.tests.values():
            for direction in test.directions:
                check_travel(machine, test.run(direction).envelope(), where=f"test {test.name} {direction}")
