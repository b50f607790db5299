"""The virtual machine: commanded paths, a nominal control, the actual geometry, and a bar between two balls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.errors import MachineError
from dbbstation.nc.circle_program import circle_toolpath
from dbbstation.nc.toolpath import RowKind
from dbbstation.sources.contract import Motion, Setup
from dbbstation.virtual.truth import SET_UP_MM, MeasurementErrors, put_up

if TYPE_CHECKING:
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.machine_model import MachineModel
    from dbbstation.nc.toolpath import Toolpath
    from dbbstation.plan.plan import Ball, Circle, Direction, Plan, PlannedTest
    from dbbstation.sources.contract import Fitted
    from dbbstation.virtual.truth import SetUp


@dataclass(frozen=True, eq=False)
class CommandedPath:
    """Poses with times; motion is even in between."""

    t_s: Floats
    poses: Floats

    @property
    def duration_s(self) -> float:
        """Return the duration [s]."""
        return float(self.t_s[-1])


def circle_path(circle: Circle) -> CommandedPath:
    """Return a run's path with dwells and corners."""
    return path_of(circle_toolpath(circle, "circle", clearance_mm=None))


def path_of(toolpath: Toolpath) -> CommandedPath:
    """Return the path of a program while the bar is on: between its first and last pause, if it has any.

    Raises:
        MachineError: it does not move.
    """
    pauses = np.flatnonzero(toolpath.kind == RowKind.PAUSE)
    first = int(pauses[0]) if len(pauses) else 0
    last = int(pauses[-1]) if len(pauses) > 1 else len(toolpath) - 1
    t_s, poses = toolpath.end_s[first : last + 1], toolpath.poses[first : last + 1]
    known = ~np.isnan(poses).any(axis=1)
    t_s, poses = t_s[known], poses[known]
    # Of rows that take no time the last holds; a path of nothing but such rows is none.
    kept = np.append(np.diff(t_s) > 0.0, True) if len(t_s) else np.zeros(0, dtype=bool)
    t_s, poses = t_s[kept], poses[kept]
    if len(t_s) < 2:  # noqa: PLR2004 - a move has two ends
        raise MachineError(
            "the program does not move the machine between its pauses",
            where=toolpath.name,
            remedy="give the program of a circle",
        )
    return CommandedPath(t_s - t_s[0], poses)


_SESSION, _BAR = "virtual session", "virtual bar"


@dataclass(frozen=True)
class Sizes:
    """Errors of the virtual measurement, as standard deviations."""

    noise_mm: float = 0.0003
    bar_uncertainty_mm: float = 0.0005
    set_up_mm: float = SET_UP_MM


@dataclass(frozen=True, eq=False)
class VirtualRun:
    """A run, which is computed before it starts.

    Attributes:
        length_mm: distance plus the bar's error at the path's times, shape (n,).
        begin_s: in virtual time.
    """

    test: str
    direction: Direction
    mounting: int
    path: CommandedPath
    length_mm: Floats
    begin_s: float = 0.0

    @property
    def end_s(self) -> float:
        """Return the end in virtual time [s]."""
        return self.begin_s + self.path.duration_s

    def length_mm_at(self, t_s: float) -> float:
        """Return the distance at a time after the start, constant beyond the ends [mm]."""
        return float(np.interp(t_s, self.path.t_s, self.length_mm))


class VirtualMachine:
    """A machine with known errors, mountable balls and circles."""

    def __init__(self, truth: MachineModel, plan: Plan, *, seed: int = 0, sizes: Sizes | None = None) -> None:
        self.sizes = sizes or Sizes()
        self.truth = truth.of_the_machine()
        self.plan = plan
        self.mountings = 0
        self.mounted: Ball | None = None
        self._scatter = MeasurementErrors(seed, self.sizes.bar_uncertainty_mm, self.sizes.set_up_mm)
        self._under_spindle: dict[int, tuple[Ball, SetUp, tuple[Fitted, ...]]] = {}
        self._bar = self._scatter.bar(_BAR)
        self._noise = np.random.default_rng([seed, 5])
        self._restarted = 0

    @property
    def bar_error_mm(self) -> float:
        """Return the bar's reading minus the true distance [mm]."""
        return float(self._bar.values[0])

    def check(self) -> None:
        """Compute every planned run once, to find impossible ones.

        Raises:
            TravelError: a circle leaves the travel.
            MachineError: the actual machine cannot take a pose.
            ModelError: a source of the truth needs missing data, such as temperatures.
        """
        self.plan.check(self.truth.machine)
        for test in self.plan.tests.values():
            path = circle_path(test.circle)
            self.truth.bar(Motion(path.poses, is_path=True, time_s=path.t_s, setup=self._setup(test.ball)))

    def mount(self, ball: Ball) -> int:
        """Mount a ball again and return the mounting's number."""
        self.mountings += 1
        self.mounted = ball
        return self.mountings

    def run(
        self, test: str, direction: Direction, *, path: CommandedPath | None = None, begin_s: float = 0.0
    ) -> VirtualRun:
        """Compute a run, and mount its ball first if needed.

        Args:
            path: None: the plan's circle.
            begin_s: time in the session, for errors over time.

        Raises:
            MachineError: an unplanned run, or an impossible pose.
            ModelError: as `check`.
        """
        planned = self._planned(test, direction)
        if self.mounted is None or self.mounted.name != planned.ball.name:
            self.mount(planned.ball)
        path = path or circle_path(planned.run(direction))
        motion = Motion(
            poses=path.poses,
            is_path=True,
            time_s=begin_s + path.t_s,
            setup=self._setup(planned.ball),
        )
        measurement = self._of_the_measurement(planned, begin_s)
        model = replace(self.truth, sources=(*self.truth.sources, *measurement))
        return VirtualRun(test, direction, self.mountings, path, model.bar(motion).length_mm)

    def restart_noise(self) -> None:
        """Restart the noise for a run, independent of earlier samples."""
        self._restarted += 1
        self._noise = np.random.default_rng([self._scatter.seed, 5, self._restarted])

    def noise_mm(self) -> float:
        """Return the next reading's error [mm]."""
        return float(self._noise.normal(0.0, self.sizes.noise_mm)) if self.sizes.noise_mm else 0.0

    def describe(self) -> dict[str, object]:
        """Return all errors by source, set and parameter, in their units, and the set-ups under the spindle."""
        under = self._under_spindle
        sources = (*self.truth.sources, *self._scatter.all(), *(f for *_, of in under.values() for f in of))
        return {
            "set_up_errors": [
                {
                    "ball": ball.name,
                    "mounting": number,
                    "fixed_ball_um": (1e3 * balls.fixed_ball_mm).tolist(),
                    "moving_ball_um": (1e3 * balls.moving_ball_mm).tolist(),
                }
                for number, (ball, balls, _) in under.items()
            ],
            "sources": [
                {
                    "name": fitted.source.name,
                    "belongs_to": fitted.source.belongs_to.value,
                    "shared": fitted.shared,
                    "parameters": fitted.by_name(self.truth.machine),
                }
                for fitted in sources
            ],
        }

    def _planned(self, test: str, direction: Direction) -> PlannedTest:
        planned = self.plan.tests.get(test)
        if planned is None or direction not in planned.directions:
            names = ", ".join(self.plan.tests)
            raise MachineError(
                f"the plan has no run {test} {direction}", where="virtual machine", remedy=f"its tests: {names}"
            )
        return planned

    def _setup(self, ball: Ball) -> Setup:
        u_mm = self.sizes.bar_uncertainty_mm
        return Setup.on(ball, session=_SESSION, mounting=self._mounting_name, instrument=_BAR, bar_uncertainty_mm=u_mm)

    def _of_the_measurement(self, test: PlannedTest, begin_s: float) -> tuple[Fitted, ...]:
        ball, number = test.ball, self.mountings
        if ball.place_known:
            of_ball = self._scatter.ball(ball, ball.name)
            return (self._bar, of_ball, self._scatter.mounting(ball, number, self._mounting_name))
        if number not in self._under_spindle:
            balls = self._scatter.set_up(number)
            stand = put_up(self.truth, test.circle, self._setup(ball), balls, begin_s)
            self._under_spindle[number] = (ball, balls, stand)
        return (self._bar, *self._under_spindle[number][2])

    @property
    def _mounting_name(self) -> str:
        return f"mounting {self.mountings}"
