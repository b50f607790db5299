"""Circles of tilted spindles are predicted that no fit has seen: [GRAV Table 3] on machines of an independent simulation.

Their gravity follows the deflected machine, their centre of gravity is somewhere else, their joints and drives rub, balls
scatter as they do in a shop. Kinematics and gravity are fitted together to the fifteen circles on the jig and conditions A
and B; C to I are predicted.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

from dbbstation.calibration.fit.calibrate import KINEMATIC_SOURCES, MEASUREMENT_SOURCES, calibrate
from dbbstation.calibration.reporting.prediction import predicted_circles
from dbbstation.cli import cli
from dbbstation.errors import ModelError
from dbbstation.model.compensation import compensated
from dbbstation.sources.contract import Motion
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from dbbstation.trace.analysis import best_circle
from tests.plant.mechanisms.backlash import Backlash
from tests.plant.mechanisms.currents import DriveCurrents
from tests.plant.mechanisms.gravity import CentreOfGravityShift, Gravity
from tests.plant.mechanisms.joints import JointFriction
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import gravity_plan, table_ii_plan
from tests.plant.session import record

HELD_OUT = "CDEFGHI"
GRAVITY = (*KINEMATIC_SOURCES, "gravity", "cog-shift")
FRICTION = ("joint-friction", "backlash")
RATE_HZ = 5.0


def hidden(seed, *, rubs=True):
    rng = np.random.default_rng([seed, 77])
    compliance = rng.uniform(7.0e-6, 13.0e-6)
    kinematics = RandomKinematics(0.1, 0.1).drawn(np.random.default_rng([seed, 5]), None)
    elastic = [kinematics, Gravity(compliance), CentreOfGravityShift(tuple(rng.normal(0.0, 8.0, 3)))]
    friction = [JointFriction(rng.uniform(0.5e4, 2.0e4), 100.0, compliance), Backlash(tuple(rng.uniform(0.0, 2.0, 6)))]
    return [*elastic, *(friction if rubs else [])]


def recorded_machine(folder, seed, *, rubs=True, drives=(), rate_hz=RATE_HZ):
    mechanisms = [*hidden(seed, rubs=rubs), *drives]
    record(folder / "jig", seed=seed, plan=table_ii_plan(seed), mechanisms=mechanisms, rate_hz=rate_hz)
    conditions = gravity_plan(seed)
    record(folder / "conditions", seed=seed + 1000, plan=conditions, mechanisms=mechanisms, rate_hz=rate_hz)
    return folder


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    @cache
    def folder_of(seed, *, rubs=True):
        return recorded_machine(tmp_path_factory.mktemp("machine"), seed, rubs=rubs)

    return folder_of


@cache
def joint(folder, names):
    seen = load_sessions([folder / "jig", folder / "conditions"], HELD_OUT)
    return calibrate(seen.machine, seen.observations, sources_named(names + MEASUREMENT_SOURCES))


def off(folder, calibration):
    """Difference of every held-out circularity as a share of what is allowed: 10 % or 1 µm."""
    held_out = load_sessions([folder / "conditions"], ["A", "B"]).observations
    circles = predicted_circles(calibration.model, held_out)
    assert len(circles) == 2 * len(HELD_OUT)
    return {
        run.label: abs(circle.predicted - circle.measured) / max(1.0, 0.1 * circle.measured)
        for run, circle in zip(held_out, circles, strict=True)
    }


# 7 and 11 are among the machines whose two directions differ so much that gravity alone does not predict them.
@pytest.mark.parametrize("seed", [7, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (4, 11))])
def test_held_out_conditions_are_predicted(machines, seed):
    folder = machines(seed)
    assert max(off(folder, joint(folder, GRAVITY + FRICTION)).values()) < 1.0


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(1, 31))
def test_held_out_conditions_are_predicted_on_many_machines(tmp_path, seed):
    folder = recorded_machine(tmp_path, seed, rate_hz=20.0)
    worst = max(off(folder, joint(folder, GRAVITY + FRICTION)).values())
    assert worst < 1.0, f"{worst:.2f} of what is allowed"


@pytest.mark.slow
def test_without_friction_among_the_sources_the_mean_of_both_directions_is_predicted(machines):
    folder = machines(7)
    calibration = joint(folder, GRAVITY)
    held_out = load_sessions([folder / "conditions"], ["A", "B"]).observations
    circles = predicted_circles(calibration.model, held_out)
    for one, other in zip(circles[::2], circles[1::2], strict=True):
        measured = (one.measured + other.measured) / 2.0
        assert one.predicted == pytest.approx(measured, rel=0.1, abs=1.0)


@pytest.mark.slow
def test_a_weight_that_is_a_fifth_too_large_predicts_the_same(machines):
    folder = machines(3, rubs=False)
    seen = load_sessions([folder / "jig", folder / "conditions"], HELD_OUT)
    held_out = load_sessions([folder / "conditions"], ["A", "B"]).observations
    names = sources_named(GRAVITY + MEASUREMENT_SOURCES)
    masses = replace(seen.machine.masses, platform_kg=1.2 * seen.machine.masses.platform_kg)
    right = joint(folder, GRAVITY).model
    heavy = calibrate(replace(seen.machine, masses=masses), seen.observations, names).model
    for one, other in zip(predicted_circles(right, held_out), predicted_circles(heavy, held_out), strict=True):
        assert other.predicted == pytest.approx(one.predicted, abs=0.02)
    with pytest.raises(ModelError, match=r"gravity needs .* a weight from the drawing is enough"):
        calibrate(replace(seen.machine, masses=None), seen.observations, names)


@pytest.mark.nightly  # that currents find it is in CI: tests/calibration/currents/test_currents.py
def test_currents_find_the_centre_of_gravity_and_predict_as_well(tmp_path):
    folder = recorded_machine(tmp_path, 4, drives=[DriveCurrents(moving_kg=0.0)])
    calibration = joint(folder, GRAVITY + FRICTION + ("drive-friction",))
    assert max(off(folder, calibration).values()) < 1.0
    true = next(m.shift_mm for m in hidden(4) if m.name == "cog-shift")
    found = next(f.values for f in calibration.model.sources if f.source.name == "cog-shift")
    assert found == pytest.approx(true, abs=0.15)  # mm; friction in the joints takes a share


def test_programs_compensated_with_the_joint_model_cut_round_on_the_machine_itself(machines, tmp_path):
    model = joint(machines(3, rubs=False), GRAVITY).model.of_the_machine()

    def corrected(slot, poses):
        del slot
        return compensated(model, Motion(poses, is_path=True))

    driven = record(
        tmp_path / "compensated",
        seed=3,
        plan=gravity_plan(3),
        mechanisms=hidden(3, rubs=False),
        setup=(),
        rate_hz=RATE_HZ,
        reprogram=corrected,
    )
    for run in driven.runs:
        theta_deg, length_mm = driven.noise_free_lengths(run.slot.test.name, run.slot.direction)
        left_um = 1e3 * np.ptp(best_circle(theta_deg, length_mm)[2])
        assert left_um < (2.0 if run.slot.test.name == "D" else 1.0), run.slot.stem


def test_the_commands_calibrate_on_two_sessions_and_predict_the_rest(machines, tmp_path):
    jig, conditions = (str(machines(3, rubs=False) / name) for name in ("jig", "conditions"))
    model = str(tmp_path / "model.yaml")
    left_out = [word for name in HELD_OUT for word in ("--exclude", name)]
    fit = ["calibrate", jig, conditions, "--sources", ",".join(GRAVITY), *left_out, "--out", model]
    said = CliRunner().invoke(cli, fit)
    assert said.exit_code == 0, said.output
    assert "27 parameters identified" in said.stdout
    answer = CliRunner().invoke(cli, ["evaluate", conditions, "--model", model, "--json"])
    runs = json.loads(answer.stdout)["runs"]
    assert [run["test"] for run in runs] == [name for name in "AB" + HELD_OUT for _ in range(2)]
    for run in runs:
        both = run["circularity_30_upr_um"]
        assert both["predicted"] == pytest.approx(both["measured"], rel=0.1, abs=1.0)
