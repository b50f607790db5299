"""Late struts and late readings in a whole calibration: what of them is found, and what is held and named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbbstation.calibration.fit.calibrate import calibrate, default_sources
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.sources.registry import known_sources
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.kinematics import RandomKinematics
from tests.plant.session import record


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    """A session without any lag, on a machine wrong by a tenth of a millimetre, and its calibration."""
    folder = tmp_path_factory.mktemp("plant") / "s"
    record(folder, seed=41, mechanisms=[RandomKinematics(length_sd_mm=0.05, base_sd_mm=0.05)], rate_hz=10.0)
    recorded = load_sessions([folder])
    return recorded, calibrate(recorded.machine, recorded.observations)


def fitted_with(clean, source, values):
    recorded, calibration = clean
    runs = []
    for run in recorded.observations:
        motion = run.motion()
        late = Fitted(source, np.array(values), source.shared_by(motion))
        changed = MachineModel(recorded.machine, (*calibration.model.sources, late)).bar(motion).length_mm
        added = changed - calibration.model.bar(motion).length_mm
        runs.append(replace(run, raw=replace(run.raw, length_mm=run.raw.length_mm + added)))
    found = calibrate(recorded.machine, runs, [*default_sources(), source])
    (columns,) = (term.columns for term in found.layout.terms if term.source is source)
    return found, found.x[columns], np.sqrt(np.diag(found.solution.covariance))[columns]


def test_lags_are_found_but_for_what_all_struts_share(clean):
    true_ms = np.array([2.0, -1.0, 1.0, 0.5, -2.0, 1.0])
    found, ms, sigma_ms = fitted_with(clean, known_sources()["servo-lag"], true_ms)
    assert any("servo-lag" in text for text in found.directions_lost)
    assert len(found.directions_lost) == len(clean[1].directions_lost) + 1
    assert np.mean(ms) == pytest.approx(0.0, abs=0.01)
    assert np.allclose(ms, true_ms - true_ms.mean(), rtol=0, atol=0.02)
    assert (sigma_ms < 0.02).all()


@pytest.mark.slow
def test_a_skew_is_found_by_the_machines_own_errors(clean):
    skew = known_sources()["time-skew"]
    _, own_ms, _ = fitted_with(clean, skew, [0.0])
    found, ms, sigma_ms = fitted_with(clean, skew, [20.0])
    assert found.directions_lost == clean[1].directions_lost
    assert 0.01 < sigma_ms[0] < 2
    assert abs(own_ms[0]) < 5
    # At this rate every run's start is uncertain too, and takes a share of what all have in common.
    assert ms[0] - own_ms[0] == pytest.approx(20.0, rel=0.08)


def test_a_time_constant_stays_where_it_is_said_to_be_known_and_is_found_where_it_is_not(clean):
    """A bar that drifted with 1500 s; a fit begun at 2000 s, which is once said to be right to a hundredth."""
    recorded, _ = clean
    drift = known_sources()["bar-drift"]
    runs = []
    for run in recorded.observations:
        grown_um = 8.0 * (1.0 - np.exp(-run.raw.t_s / 1500.0))
        runs.append(replace(run, raw=replace(run.raw, length_mm=run.raw.length_mm + 1e-3 * grown_um)))
    found = []
    for within in (None, 0.01):
        start = {"bar-drift": np.array([6.0, 2000.0, 0.0])}
        fit = calibrate(recorded.machine, runs, [*default_sources(), drift], start, shapes_within=within)
        column = [(source, name) for source, _, name in fit.layout.names].index(("bar-drift", "time_constant_s"))
        found.append((fit.x[column], float(np.sqrt(fit.solution.covariance[column, column]))))
    (free_s, free_sigma_s), (kept_s, kept_sigma_s) = found
    assert free_s == pytest.approx(1500.0, abs=4.0 * free_sigma_s)
    assert free_sigma_s > 50.0
    assert kept_s == pytest.approx(2000.0, abs=60.0)
    assert kept_sigma_s < 20.1
