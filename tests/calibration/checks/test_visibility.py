"""What a calibration says of its own matrix, against dense formulas and against leaving tests out."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.calibration.checks.visibility import indices, visibility
from dbbstation.calibration.fit.calibrate import calibrate
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.registry import sources_named
from studies.virtual_session import draw_session
from tests.calibration.checks.sensitivity import plan_sensitivity

SAMPLES = 90


@pytest.fixture(scope="module")
def machine():
    return read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")


@pytest.fixture(scope="module", params=["table2", "table2-elevated"])
def case(request, machine):
    """A machine without errors, so that the fit stands where the plan's own sensitivity was taken."""
    plan = read_plan(shipped_folder("protocols") / "plans" / f"{request.param}.yaml")
    return plan, calibrate(
        machine, draw_session(MachineModel(machine), plan, np.random.default_rng(1), 0.0005, SAMPLES)
    )


def test_singular_values_are_those_of_the_dense_matrix(machine, case):
    plan, calibration = case
    seen = visibility(calibration)
    dense = plan_sensitivity(machine, plan, sources_named(("strut-reference-length", "base-joints")))
    scaled = dense.matrix * calibration.layout.known.scale[:24]
    # The plan's matrix has one direction of each circle, 180 angles; the runs have both, 90 angles each.
    expected = np.linalg.svd(scaled, compute_uv=False)[: calibration.parameters_identified]
    assert seen.singular_values_mm == pytest.approx(expected, rel=1e-3)
    assert seen.condition == pytest.approx(expected[0] / expected[-1], rel=1e-3)


def test_indices_of_known_singular_values():
    """Sun and Hollerbach's definitions by hand, for 4, 2, 1 and 16 readings."""
    o = indices(np.array([4.0, 2.0, 1.0]), 16)
    assert o.o1 == pytest.approx(2.0 / 4.0)
    assert (o.o2, o.o3, o.o4) == (0.25, 1.0, 0.25)
    assert o.o5 == pytest.approx(1.0 / 1.75)


def test_the_weakest_direction_is_as_uncertain_as_the_covariance_says(case):
    _, calibration = case
    seen = visibility(calibration)
    covariance = calibration.solution.covariance[:24, :24]
    scale = calibration.layout.known.scale[:24]
    axis = np.linalg.eigh(covariance / np.outer(scale, scale))[1][:, -1]
    # Along an eigenvector of the scaled covariance a parameter moves by its share of the standard deviation.
    sigma = np.sqrt(axis @ (covariance / np.outer(scale, scale)) @ axis)
    assert seen.weak_directions[0].uncertainty == pytest.approx(1e3 * sigma * np.abs(scale * axis).max())
    assert {weak.unit for weak in seen.weak_directions} == {"µm"}
    assert [w.uncertainty for w in seen.weak_directions] == sorted(
        (w.uncertainty for w in seen.weak_directions), reverse=True
    )


def test_correlations_are_the_largest_of_the_covariance(case):
    _, calibration = case
    names = [f"{source} {parameter}" for source, _, parameter in calibration.layout.names]
    sigma = np.sqrt(np.diag(calibration.solution.covariance))
    values = [c.value for c in visibility(calibration).correlations]
    for told in visibility(calibration).correlations:
        i, j = names.index(told.first), names.index(told.second)
        assert told.value == pytest.approx(calibration.solution.covariance[i, j] / (sigma[i] * sigma[j]))
    assert np.abs(values).tolist() == sorted(np.abs(values), reverse=True)
    assert np.abs(values).max() <= 1.0


def test_leverage_adds_up_to_the_parameters_and_tells_what_a_test_is_worth(machine, case):
    plan, calibration = case
    leverage = visibility(calibration).leverage
    # They add up to the parameters and the share of the bar's length that comes from the circles, not its calibrator.
    (bar,) = (k for k, (source, _, _) in enumerate(calibration.layout.names) if source == "bar-offset")
    share = 1.0 - calibration.solution.covariance[bar, bar] / calibration.layout.known.prior[bar] ** 2
    assert sum(leverage.values()) == pytest.approx(calibration.parameters_identified + share, rel=1e-6)
    # Without the test of most leverage more is forgotten than without that of least.
    runs = draw_session(MachineModel(machine), plan, np.random.default_rng(1), 0.0005, SAMPLES)

    def forgotten(test):
        left = calibrate(machine, [run for run in runs if run.test != test])
        return np.log(np.diag(left.solution.covariance)[:24] / np.diag(calibration.solution.covariance)[:24]).sum()

    most, least = max(leverage, key=leverage.get), min(leverage, key=leverage.get)
    assert forgotten(most) > forgotten(least) > 0.0
