"""Circles by test, before and after calibration, and their centres over the plate [CAL Fig 6]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.calibration.checks.scatter import LEAST_STATED_MM, seats_of
from dbbstation.calibration.fit.calibrate import residuals
from dbbstation.calibration.reporting.residual_map import names_of_tests
from dbbstation.model.machine_model import MachineModel
from dbbstation.trace.analysis import figures
from dbbstation.trace.circle import by_angle

if TYPE_CHECKING:
    from dbbstation.calibration.fit.calibrate import Calibration
    from dbbstation.computing.arrays import Floats
    from dbbstation.model.observation import Observation
    from dbbstation.plan.circle import Direction

SECTORS = 180
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
    names = names_of_tests(observations)
    return tuple(
        _test(
            name,
            [
                (observation, before, after)
                for observation, before, after, own in zip(
                    observations, nominal, calibration.machine_residual_mm, names, strict=True
                )
                if own == name
            ],
        )
        for name in dict.fromkeys(names)
    )


def ball_shifts(calibration: Calibration) -> tuple[BallShift, ...]:
    """Return shifts of balls at stated places, without freed balls and balls under the spindle."""
    tests: dict[str, list[str]] = {}
    for observation, name in zip(calibration.observations, names_of_tests(calibration.observations), strict=True):
        tests.setdefault(observation.setup.mounting, []).append(name)
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
        theta, (before, after) = by_angle(raw, [1e3 * left for left in both], SECTORS)
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
