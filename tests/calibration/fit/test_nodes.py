"""Nodes say what all samples say: estimates, uncertainties, noise; and they are not used where they would not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.fit import nodes
from dbbstation.calibration.fit.calibrate import calibrate, linearise, looked_at, residuals
from dbbstation.calibration.fit.nodes import RunNodes, nodes_of, smooth
from dbbstation.calibration.layout import lay_out
from dbbstation.sources.contract import Effect, LinearSource, Need, Owner, Parameter
from dbbstation.sources.registry import sources_named
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.plan import elevated, subset, table_ii_plan
from tests.plant.session import record

ERRORS = RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.1)
USUAL = ("strut-reference-length", "base-joints", "mounting", "ball-coordinate", "bar-offset")


@pytest.fixture(scope="module", params=["abhk", pytest.param("abcdefghijklmno", marks=pytest.mark.nightly)])
def long_runs(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant") / "long"
    record(
        folder,
        seed=7,
        plan=elevated(subset(table_ii_plan(7), request.param), 5.0, "abcde"),
        mechanisms=[ERRORS],
        rate_hz=200.0,
    )
    return load_sessions([folder])


def without_nodes(monkeypatch):
    monkeypatch.setattr(nodes, "LONG", 10**9)


@pytest.mark.slow
@pytest.mark.parametrize("more", [pytest.param((), marks=pytest.mark.nightly), ("gravity", "bar-drift")])
def test_a_fit_through_nodes_is_that_of_all_samples(long_runs, monkeypatch, more):
    sources = sources_named((*USUAL, *more))
    seen = calibrate(long_runs.machine, long_runs.observations, sources)
    without_nodes(monkeypatch)
    whole = calibrate(long_runs.machine, long_runs.observations, sources)
    sigma = np.sqrt(np.diag(whole.solution.covariance))
    seen_sigma = np.sqrt(np.diag(seen.solution.covariance))
    assert np.abs(seen.x - whole.x).max(initial=0.0, where=sigma == 0.0) == 0.0
    free = sigma > 0.0
    assert np.abs((seen.x - whole.x)[free] / sigma[free]).max() < 1e-6
    assert np.allclose(seen_sigma, sigma, rtol=1e-6)
    assert seen.noise.sigma == pytest.approx(whole.noise.sigma, rel=1e-9)
    assert seen.noise.correlation_samples == pytest.approx(whole.noise.correlation_samples, rel=1e-9)
    assert seen.solution.chi2 == pytest.approx(whole.solution.chi2, rel=1e-9)
    for few, every in zip(seen.residual_mm, whole.residual_mm, strict=True):
        assert np.abs(few - every).max() < 1e-8
    assert all(len(left) == len(o.raw) for left, o in zip(seen.machine_residual_mm, seen.observations, strict=True))


def test_every_long_run_is_looked_at_through_nodes(long_runs):
    assert all(
        isinstance(run, RunNodes) for run in looked_at(long_runs.observations, frozenset({Need.POSE, Need.TIME}))
    )


@pytest.mark.parametrize("need", [Need.PATH, Need.TEMPERATURE, Need.CURRENT])
def test_what_has_a_history_or_was_logged_is_looked_at_sample_by_sample(long_runs, need):
    runs = looked_at(long_runs.observations, frozenset({Need.POSE, need}))
    assert all(run is observation for run, observation in zip(runs, long_runs.observations, strict=True))


def test_short_runs_and_commanded_ones_have_no_nodes(long_runs):
    run = long_runs.observations[0]
    raw = run.raw
    short = replace(raw, t_s=raw.t_s[::20], phi_deg=raw.phi_deg[::20], length_mm=raw.length_mm[::20])
    assert nodes_of(replace(run, raw=short)) is None
    assert nodes_of(replace(run, commanded=run.motion().poses)) is None


def test_samples_at_odd_places_and_gaps_are_no_matter(long_runs, rng):
    run = long_runs.observations[0]
    phi = rng.uniform(0.0, 360.0, 5000)
    phi = phi[(phi < 42.0) | (phi > 48.0)]
    theta = np.radians(phi)
    length = 150.0 + 0.1 * np.cos(theta) + 0.05 * np.sin(2.0 * theta)
    raw = replace(run.raw, t_s=phi, phi_deg=phi, length_mm=length, logged={})
    found = nodes_of(replace(run, raw=raw))
    assert found is not None
    at = np.radians(found.coarse.raw.phi_deg)
    again = found.samples_of(150.0 + 0.1 * np.cos(at) + 0.05 * np.sin(2.0 * at))
    assert np.abs(again - length).max() < 1e-9
    jacobian = np.column_stack([np.cos(at), np.sin(2.0 * at), np.ones(len(at))])
    block = found.compressed(np.arange(3), jacobian, np.full(len(at), 150.0), np.zeros(3))
    x, *_ = np.linalg.lstsq(block.triangle, block.target)
    assert np.allclose(x, [0.1, 0.05, 0.0], atol=1e-9)
    assert block.count == len(phi)


def test_smoothness_is_told_from_a_step_and_from_rounding(long_runs, rng):
    run = nodes_of(long_runs.observations[0])
    assert run is not None
    at = np.radians(run.coarse.raw.phi_deg)
    waves = np.column_stack([np.cos(at), np.sin(3.0 * at), np.zeros_like(at), 1e-12 * rng.normal(size=len(at))])
    assert smooth(waves)
    for where in (0.3, np.radians(90.0), np.radians(90.05)):  # within a sector, between two, before the first node
        assert not smooth(np.column_stack([waves, np.sign(np.sin(at - where))]))
    assert not smooth(np.cos(40.0 * at)[:, None])


class Threshold(LinearSource):
    """Struts that lengthen all at once where X is positive: a step that the contract calls a function of the pose."""

    name = "threshold"
    belongs_to = Owner.MACHINE

    def parameters(self, machine):  # noqa: ARG002
        return (Parameter("step_mm", "mm", 0.01, "all struts together"),)

    def derivative(self, motion, machine, values):  # noqa: ARG002
        return Effect(strut_mm=np.repeat((motion.poses[:, :1] > 0.0)[:, :, None], 6, axis=1).astype(float))


def test_a_step_is_looked_at_sample_by_sample(long_runs):
    sources = (*sources_named(USUAL), Threshold())
    observations = [o for o in long_runs.observations if np.ptp(np.sign(o.motion().poses[:, 0])) == 2.0]
    assert len(observations) > 4
    layout = lay_out(long_runs.machine, sources, observations)
    x = layout.nominal.copy()
    x[:24] = 0.01
    seen, seen_left = linearise(layout, looked_at(observations, layout.needs), x)
    whole, whole_left = linearise(layout, observations, x)
    for a, b in zip(seen, whole, strict=True):
        assert np.array_equal(a.triangle, b.triangle)
    assert all(np.array_equal(a, b) for a, b in zip(seen_left, whole_left, strict=True))
    x[layout.terms[-1].columns] = 0.01
    model = layout.model(x)
    left = residuals(model, observations)
    for run, rest in zip(observations, left, strict=True):
        assert np.array_equal(rest, run.raw.length_mm - model.bar(run.motion()).length_mm)
