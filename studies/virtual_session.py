"""Sessions drawn from a model, with all scatter."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dbbstation.model.machine_model import MachineModel
from dbbstation.model.observation import Observation
from dbbstation.model.simulation import setup_of, simulate_circle
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.trace.recording import RawCircle
from dbbstation.virtual.truth import SET_UP_MM, SetUp, put_up

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from dbbstation.plan.plan import Plan, PlannedTest
    from dbbstation.sources.contract import Motion, Setup

BAR_UNCERTAINTY_MM = 0.0005
SPACING_S = 200.0
"""From the start of one run to the next, holder changes included [s]."""


def draw_session(
    truth: MachineModel,
    plan: Plan,
    rng: np.random.Generator,
    noise_mm: float,
    samples: int = 720,
    micrometer_mm: float | None = None,
    command: Callable[[Motion], NDArray[np.float64]] | None = None,
) -> list[Observation]:
    """Record a plan once, with new mountings for each test.

    A micrometer changes no other draw.

    Args:
        rng: of mountings, CMM, bar and noise at the plan's sizes; `SET_UP_MM` under the spindle.
        micrometer_mm: standard deviation; None: no micrometer.
        command: from wanted motion to commands.
    """
    known = known_sources()
    bar = Fitted(known["bar-offset"], rng.normal(0.0, BAR_UNCERTAINTY_MM, 1), "study")
    balls: dict[str, Fitted] = {}
    observations: list[Observation] = []
    for test in plan.tests.values():
        setup = _setup(test)
        started_s = len(observations) * SPACING_S
        if test.ball.place_known:
            if setup.ball not in balls:
                error = rng.normal(0.0, max(test.ball.uncertainty_mm, 1e-12), 3)
                balls[setup.ball] = Fitted(known["ball-coordinate"], error, setup.ball)
            shift = rng.normal(0.0, max(test.ball.repeatability_mm, 1e-12), 3)
            mounted: tuple[Fitted, ...] = (balls[setup.ball], Fitted(known["mounting"], shift, setup.mounting))
        else:
            stands = SetUp.drawn(rng, SET_UP_MM)
            mounted = put_up(truth, test.circle, setup, stands, started_s)
            read = stands.read(rng, micrometer_mm or 0.0)
            setup = replace(setup, set_up_errors=None if micrometer_mm is None else read)
        actual = MachineModel(truth.machine, (*truth.sources, bar, *mounted))
        for direction in test.directions:
            circle = test.run(direction)
            started_s = len(observations) * SPACING_S
            turn = simulate_circle(actual, circle, setup, samples, started_s, command)
            length = turn.length_mm + rng.normal(0.0, noise_mm, samples)
            phi = np.linspace(0.0, 360.0, samples, endpoint=False, dtype=np.float64)
            raw = RawCircle(f"{test.name} {direction}", circle, turn.t_s, phi, length)
            poses = None if command is None else turn.commanded
            observations.append(Observation(test.name, 1, raw, setup, started_s, poses))
    return observations


def _setup(test: PlannedTest) -> Setup:
    return replace(
        setup_of(test),
        session="study",
        instrument="bar",
        bar_uncertainty_mm=BAR_UNCERTAINTY_MM,
        place_known=test.ball.place_known,
    )
