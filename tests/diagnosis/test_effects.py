"""What each cause contributes, against the independent virtual machine and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from dbbstation.calibration.reporting.prediction import smooth_circularities_um
from dbbstation.diagnosis.effects import GEOMETRY, effects_of, workspace
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted, Motion
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.load import load
from tests.diagnosis.ranked import scored, truth_of
from tests.plant.mechanisms.gravity import Gravity
from tests.plant.mechanisms.kinematics import Kinematics
from tests.plant.mechanisms.servo import ServoLag
from tests.plant.noise import Noise
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record

LAG_MS = (2.0, 3.0, 1.0, 2.5, 4.0, 0.5)
COMPLIANCE = 5e-6


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """A model that is the truth, the runs of a machine with it, and what each mechanism does there by itself."""
    folder = tmp_path_factory.mktemp("effects")
    rng = np.random.default_rng(8)
    length, base = rng.normal(0.0, 0.02, 6), rng.normal(0.0, 0.02, (6, 3))
    mechanisms = [Kinematics(length_mm=length, base_mm=base), Gravity(COMPLIANCE), ServoLag(LAG_MS)]
    plan = subset(table_ii_plan(8), ["a", "g", "n"])
    truth = truth_of(folder, 8, plan, mechanisms)
    record(
        folder / "s",
        seed=8,
        plan=plan,
        mechanisms=mechanisms,
        setup=[],
        noise=Noise(white_um=0.0),
        rate_hz=10.0,
        angles=True,
    )
    recorded = load(folder / "s")
    sources = known_sources()
    fitted = (
        Fitted(sources["strut-reference-length"], length),
        Fitted(sources["base-joints"], base.ravel()),
        Fitted(sources["gravity"], np.array([1e6 * COMPLIANCE])),
        Fitted(sources["servo-lag"], np.array(LAG_MS)),
    )
    return MachineModel(recorded.machine, fitted), recorded.observations, truth


def test_contributions_are_those_of_the_virtual_machine(known):
    model, runs, truth = known
    found = {one.cause: one for one in effects_of(model, runs)}
    assert set(found) == {GEOMETRY, "gravity", "servo-lag"}
    for name, one in found.items():
        assert one.g_um == pytest.approx(truth[name], rel=0.01, abs=0.02), name
    order = [one.cause for one in effects_of(model, runs)]
    assert order == sorted(truth, key=lambda name: -truth[name])


def test_a_circle_without_a_cause_is_the_circle_of_a_machine_without_it(known):
    model, runs, _ = known
    gravity = next(one for one in effects_of(model, runs) if one.cause == "gravity")
    for circle, run in zip(gravity.runs, runs, strict=True):
        assert circle.measured_g_um == pytest.approx(smooth_circularities_um(run.raw, [run.raw.length_mm])[0])
        np.testing.assert_allclose(circle.measured_centre_um - circle.cured_centre_um, circle.centre_um, atol=1e-9)
        np.testing.assert_allclose(circle.raw.length_mm, run.raw.length_mm)
    alone = next(iter(effects_of(MachineModel(model.machine, (model.sources[2],)), runs)))
    assert alone.g_um == pytest.approx(gravity.g_um, rel=0.01)


def test_a_cause_of_one_amplitude_is_known_as_well_as_its_amplitude(known):
    model, runs, _ = known
    (rows,) = [[("gravity", "", one.name) for one in model.sources[2].source.parameters(model.machine)]]
    share = 0.03
    covariance = np.array([[(share * model.sources[2].values[0]) ** 2]])
    gravity = next(one for one in effects_of(model, runs, rows, covariance) if one.cause == "gravity")
    assert gravity.g_u_um == pytest.approx(share * gravity.g_um, rel=0.03)
    assert gravity.centre_u_um == pytest.approx(share * gravity.centre_um, rel=0.03)
    assert gravity.workspace_u_um == pytest.approx(share * gravity.workspace_um, rel=0.03)
    geometry = next(one for one in effects_of(model, runs, rows, covariance) if one.cause == GEOMETRY)
    assert geometry.g_u_um is None


def test_what_a_formula_lacks_it_lacks_on_every_strut(known):
    model, runs, _ = known
    lag = model.sources[3]
    rows = [("servo-lag", "", one.name) for one in lag.source.parameters(model.machine)]
    of_formula = (0.1 * lag.values) ** 2
    covariance = np.diag(of_formula)

    def u_of_g(formula):
        (found,) = (one for one in effects_of(model, runs, rows, covariance, None, formula) if one.cause == "servo-lag")
        return found.g_u_um / found.g_um

    assert u_of_g(of_formula) == pytest.approx(0.1, rel=0.02)
    assert u_of_g(None) != pytest.approx(0.1, rel=0.2)


def test_what_was_not_determined_leaves_the_workspace_without_an_uncertainty(known):
    model, runs, _ = known
    names = [(f.source.name, "", p.name) for f in model.sources[:2] for p in f.source.parameters(model.machine)]
    covariance = np.diag(np.full(len(names), 1e-6**2))
    strut = np.zeros((1, len(names)))
    strut[0, 0] = 0.1
    sure = next(one for one in effects_of(model, runs, names, covariance) if one.cause == GEOMETRY)
    unsure = next(one for one in effects_of(model, runs, names, covariance, strut) if one.cause == GEOMETRY)
    assert sure.workspace_u_um is not None
    assert unsure.workspace_u_um is None
    assert unsure.g_u_um == pytest.approx(sure.g_u_um)


def test_over_the_workspace_a_cause_is_what_poses_say(known):
    model, runs, _ = known
    geometry = next(one for one in effects_of(model, runs) if one.cause == GEOMETRY)
    motion = Motion(workspace(model.machine))
    anywhere = model.anywhere()
    rest = MachineModel(model.machine, tuple(f for f in anywhere.sources if f.source.name == "gravity"))
    apart = 1e3 * (anywhere.actual_poses(motion) - rest.actual_poses(motion))[:, :3]
    expected = np.sqrt(np.mean(np.sum((apart - apart.mean(axis=0)) ** 2, axis=1)))
    assert geometry.workspace_um == pytest.approx(expected, rel=1e-6)
    lag = next(one for one in effects_of(model, runs) if one.cause == "servo-lag")
    assert lag.workspace_um is None


@pytest.mark.nightly  # half a minute each; docs/diagnosis.md has the figures of twenty
@pytest.mark.parametrize("session", range(5))
def test_ranked_causes_of_drawn_machines(session, tmp_path):
    one = scored(session, 35, tmp_path)
    assert all(one.orders)
    assert all(abs(value) < 3.5 for value in one.deviations.values()), one
