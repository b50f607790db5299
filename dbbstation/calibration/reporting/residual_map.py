"""Data of a calibration's figure: residuals over test and angle, circles and balls on the plate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import LEAST_STATED_MM, seats_of
from dbbstation.calibration.fit.calibrate import residuals
from dbbstation.computing.grouped import grouped
from dbbstation.computing.threads import with_one_thread
from dbbstation.inference.harmonics import smooth
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.trace.analysis import figures
from dbbstation.trace.recording import by_angle

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation


SECTORS = 36
"""Means of ten degrees."""


@dataclass(frozen=True, eq=False)
class ResidualMap:
    """Mean smooth residuals over test and angle.

    Attributes:
        um: arrays by direction, shape (tests, 36) each [µm]: rows are tests, columns angles from +X towards +Y; NaN for gaps.
    """

    tests: tuple[str, ...]
    um: Mapping[Direction, Floats]

    @property
    def reach_um(self) -> float:
        """Return the greatest absolute value [µm]."""
        return float(np.nanmax(np.abs(np.concatenate(list(self.um.values())))))


@with_one_thread
def residual_map(observations: Sequence[Observation], residual_mm: Sequence[Floats]) -> ResidualMap:
    """Return residuals without noise, averaged over ten degrees."""
    names = names_of_tests(observations)
    rows = {name: k for k, name in enumerate(dict.fromkeys(names))}
    um = {direction: np.full((len(rows), SECTORS), np.nan) for direction in Direction}
    for observation, residual, name in zip(observations, residual_mm, names, strict=True):
        um[observation.raw.circle.direction][rows[name]] = _by_angle_um(observation, residual)
    return ResidualMap(tuple(rows), um)


def names_of_tests(observations: Sequence[Observation]) -> list[str]:
    """Return each run's label: its test, with a number if repeated and the session if there are several."""
    repeated = any(o.repeat > 1 for o in observations)
    several = len({o.setup.session for o in observations}) > 1
    return [
        (f"{o.setup.session} " if several else "") + o.test + (f" {o.repeat}" if repeated else "") for o in observations
    ]


def _by_angle_um(observation: Observation, residual_mm: Floats) -> Floats:
    curve = smooth(residual_mm, np.radians(observation.raw.phi_deg))
    sector = (observation.raw.theta_deg * (SECTORS / 360.0)).astype(np.int64) % SECTORS
    count = np.bincount(sector, minlength=SECTORS)
    sums = np.bincount(sector, curve, minlength=SECTORS)
    return np.where(count > 0, 1e3 * sums / np.maximum(count, 1), np.nan)


CIRCLE_SECTORS = 180
"""Points of a circle: means of two degrees."""


@dataclass(frozen=True, eq=False)
class CircleBeforeAfter:
    """One run's deviations, in ascending order of angle, shape (s,) each.

    Attributes:
        before_um: measured length less the nominal prediction; for plain circles less the nominal bar length.
        after_um: measured length less the model's prediction, with balls and bar as stated.
    """

    direction: Direction
    theta_deg: Floats
    before_um: Floats
    after_um: Floats


@dataclass(frozen=True, eq=False)
class CircleTest:
    """One test with all its runs.

    Attributes:
        ball_mm: by CMM, machine frame, shape (3,).
        centre_um: mean centre of its runs from the ball; rows before and after, columns x and y, shape (2, 2).
    """

    name: str
    ball_mm: Floats
    circles: tuple[CircleBeforeAfter, ...]
    circularity_um: tuple[float, float]
    centre_um: Floats


@dataclass(frozen=True, eq=False)
class BallShift:
    """A ball's displacement found by the fit.

    Attributes:
        shift_um: found less stated place in X and Y, shape (2,).
    """

    tests: tuple[str, ...]
    stated_um: float
    shift_um: Floats
    sigma_um: Floats


def circle_tests(calibration: Calibration) -> tuple[CircleTest, ...]:
    """Return every test's circles and centres, in recording order."""
    observations, model = calibration.observations, calibration.model
    nominal = residuals(MachineModel(model.machine), observations)
    runs = zip(observations, nominal, calibration.machine_residual_mm, strict=True)
    tests = grouped(zip(names_of_tests(observations), runs, strict=True))
    return tuple(_test(name, own) for name, own in tests.items())


def ball_shifts(calibration: Calibration) -> tuple[BallShift, ...]:
    """Return shifts of balls at stated places, without freed balls and balls under the spindle."""
    named = zip(calibration.observations, names_of_tests(calibration.observations), strict=True)
    tests = grouped((observation.setup.mounting, name) for observation, name in named)
    return tuple(
        BallShift(
            tests=tuple(dict.fromkeys(tests[seat.mounting])),
            stated_um=1e3 * float(seat.stated_mm[0]),
            shift_um=1e3 * seat.shift_mm[:2],
            sigma_um=1e3 * np.sqrt(np.diag(seat.spread_mm2)[:2]),
        )
        for seat in seats_of(calibration)
        if seat.stated_mm[0] < LEAST_STATED_MM
    )


def _test(name: str, runs: list[tuple[Observation, Floats, Floats]]) -> CircleTest:
    circles, found = [], []
    for observation, *both in runs:
        raw = observation.raw
        theta, (before, after) = by_angle(raw, [1e3 * left for left in both], CIRCLE_SECTORS)
        circles.append(CircleBeforeAfter(raw.circle.direction, theta, before, after))
        found.append([figures(raw, raw.circle.bar_mm + left) for left in both])
    worst = [max(of_run[k].circularity_um for of_run in found) for k in (0, 1)]
    return CircleTest(
        name=name,
        ball_mm=runs[0][0].setup.fixed_ball_mm,
        circles=tuple(circles),
        circularity_um=(worst[0], worst[1]),
        centre_um=1e3 * np.mean([[one.centre_mm for one in of_run] for of_run in found], axis=0),
    )
