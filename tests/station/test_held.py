"""A gauge that does not follow the machine ends the run within two seconds, not when patience is out."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from dbbstation.plan.plan import Direction
from dbbstation.station import events
from dbbstation.station.commands import Start
from dbbstation.station.schedule import Schedule
from dbbstation.station.sequencer import Sequencer
from tests.station.readings import run_readings, told_and_untold
from tests.station.test_sequencer import plan  # noqa: F401 - a fixture

if TYPE_CHECKING:
    from dbbstation.instrument.reading import Reading
    from dbbstation.plan.plan import Plan

RATE_HZ = 50.0


def noisy(readings: list[Reading], white_um: float, step_um: float) -> list[Reading]:
    rng = np.random.default_rng(5)
    step_mm = 1e-3 * step_um
    return [
        replace(one, length_mm=step_mm * round((one.length_mm + 1e-3 * rng.normal(0.0, white_um)) / step_mm))
        for one in readings
        if one.length_mm is not None
    ]


def stuck(readings: list[Reading], from_s: float) -> list[Reading]:
    last = next(one.length_mm for one in readings if one.t_s >= from_s)
    return [one if one.t_s < from_s else replace(one, length_mm=last) for one in readings]


def ended(plan: Plan, readings: list[Reading]) -> tuple[events.RunCompleted, float]:  # noqa: F811
    told: list[events.Event] = []
    sequencer = Sequencer(plan, Schedule(plan, lambda _test, _direction: 1), told_and_untold(told))
    sequencer.begin()
    sequencer.command(Start())
    for one in readings:
        told += (new := sequencer.readings([one]))
        for event in new:
            if isinstance(event, events.RunCompleted):
                return event, one.t_s
    raise AssertionError(f"the run goes on: {sequencer.state}")


def test_a_length_that_sticks_on_the_turn_ends_the_run_within_two_seconds(plan: Plan) -> None:  # noqa: F811
    circle = plan.tests["a"].run(Direction.CCW)
    sound = noisy(run_readings(circle, rate_hz=RATE_HZ), 0.5, 0.1)
    assert ended(plan, sound)[0].problem == ""
    completed, at_s = ended(plan, stuck(sound, 30.0))
    assert completed.figures is None
    assert "the length has stood at " in completed.problem
    assert completed.problem.endswith("run the circle again")
    assert at_s - 30.0 < 2.0


def test_a_coarse_length_that_sticks_ends_the_run_when_the_feed_out_must_have_moved_it(plan: Plan) -> None:  # noqa: F811
    circle = plan.tests["a"].run(Direction.CCW)
    coarse = noisy(run_readings(circle, rate_hz=RATE_HZ), 0.0, 1.0)
    completed, sound_s = ended(plan, coarse)
    assert completed.problem == ""
    stopped, at_s = ended(plan, [*stuck(coarse, 30.0), *stuck_behind(coarse)])
    assert "the length has stood at " in stopped.problem
    assert at_s - sound_s < 2.0


def stuck_behind(readings: list[Reading]) -> list[Reading]:
    last = next(one for one in readings if one.t_s >= 30.0)
    return [replace(last, t_s=readings[-1].t_s + k / RATE_HZ) for k in range(1, 3000)]


@pytest.mark.parametrize("override", [0.8, 0.6])
def test_a_slow_circle_that_moves_is_waited_for(plan: Plan, override: float) -> None:  # noqa: F811
    circle = plan.tests["a"].run(Direction.CCW)
    readings = noisy(run_readings(circle, rate_hz=RATE_HZ), 0.5, 0.1)
    slow = [replace(one, t_s=one.t_s / override) for one in readings]
    completed, _ = ended(plan, slow)
    assert "stood" not in completed.problem
