"""A jig that is bumped once: all balls after it stand elsewhere, those before it where they stood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.sources.causes.jig_bump import JigBump
from tests.sources.runs import random_run

BUMP = JigBump()
SHIFT_UM = (2.0, -6.0, 1.0)


def run_at(start_s, moving_s=((0.0, 100.0), (200.0, 300.0), (400.0, 500.0))):
    motion = random_run(np.random.default_rng(1), 5)
    setup = replace(motion.setup, moving_s=moving_s)
    return replace(motion, time_s=start_s + np.linspace(0.0, 100.0, 5), setup=setup)


@pytest.mark.parametrize(("start_s", "moved"), [(0.0, False), (200.0, True), (400.0, True)])
def test_balls_of_runs_after_it_are_shifted(reference, start_s, moved):
    found = BUMP.effect(run_at(start_s), reference, np.array([*SHIFT_UM, 1.0])).fixed_ball_mm
    assert found == pytest.approx(1e-3 * np.array(SHIFT_UM) * moved)


@pytest.mark.parametrize("off", [-1e-12, 1e-12])
def test_a_number_of_runs_that_a_fit_has_rounded_is_that_number(reference, off):
    found = BUMP.effect(run_at(200.0), reference, np.array([*SHIFT_UM, 1.0 + off])).fixed_ball_mm
    assert found == pytest.approx(1e-3 * np.array(SHIFT_UM))
    assert not BUMP.effect(run_at(0.0), reference, np.array([*SHIFT_UM, 1.0 + off])).fixed_ball_mm.any()


def test_the_shift_is_proportional_to_its_parameters(reference):
    found = BUMP.derivative(run_at(400.0), reference, np.array([*SHIFT_UM, 2.0])).fixed_ball_mm
    assert found @ np.array([*SHIFT_UM, 0.0]) == pytest.approx(1e-3 * np.array(SHIFT_UM))


def test_it_is_looked_for_where_there_are_runs_before_and_after_it():
    runs = [run_at(0.0), run_at(200.0), run_at(400.0)]
    assert [BUMP.shows(runs, (float(k),)) for k in (1, 2, 3)] == [True, True, False]
    assert not BUMP.shows(runs[1:], (1.0,))


def test_a_motion_without_time_is_refused(reference, rng):
    with pytest.raises(ModelError, match="jig-bump needs time"):
        BUMP.effect(replace(random_run(rng), time_s=None), reference, np.array([*SHIFT_UM, 1.0]))
