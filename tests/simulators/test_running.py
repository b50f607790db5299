"""Simulations in processes and on disk: each is run once, and one of other content is another."""

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.model import SimulationRequest
from dbbstation.diagnosis.simulator.terms import Term, TermForm
from dbbstation.diagnosis.simulator.work import BudgetSpentError
from dbbstation.simulators import kept
from dbbstation.simulators.loading import load_simulator
from dbbstation.simulators.running import Runs
from tests.cli.test_mismatch_simulator import PYTHON, YAML


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "simulations_folder", lambda: tmp_path / "kept")
    (tmp_path / "model.yaml").write_text(YAML)
    (tmp_path / "decay.py").write_text(PYTHON.replace("FAULT", "pass"))
    rows = "\n".join(f"{0.05 * k:.3f},{2.0 * np.exp(-0.025 * k):.6f}" for k in range(100))
    (tmp_path / "run.csv").write_text(f"t_s,level_m\n{rows}\n")
    return tmp_path


def ask(rate, terms=()):
    return SimulationRequest(0, (("rate", rate), ("level", 2.0)), terms)


def ran(folder, *asks, keeps=True):
    loaded = load_simulator(folder / "model.yaml", [folder / "run.csv"])
    with Runs(loaded, 0, keeps=keeps) as runs:
        found = [one.outputs for one in runs(asks)]
        return runs.ran, found


DRAIN = Term("flow", TermForm.CONSTANT, (), (-0.1,))


def test_a_simulation_is_run_once_whoever_asks(folder):
    first = ran(folder, ask(0.5), ask(0.5), ask(0.4, (DRAIN,)))
    assert first[0] == 2
    again = ran(folder, ask(0.5), ask(0.4, (DRAIN,)), ask(0.3))
    assert again[0] == 1
    np.testing.assert_array_equal(first[1][0], again[1][0])
    np.testing.assert_array_equal(first[1][2], again[1][1])
    # Euler's steps of dx/dt = -x/2, by hand.
    np.testing.assert_allclose(again[1][0][0], 2.0 * 0.975 ** np.arange(100), rtol=1e-12)


@pytest.mark.parametrize(
    ("file", "before", "after", "expected"),
    [
        ("model.yaml", "high: 2}", "high: 3}", 0),  # bounds are no content of a simulation
        ("model.yaml", "unit: m}\nports", "unit: m, filter_s: 0.1}\nports", 1),
        ("decay.py", "pass", "pass  # changed", 1),
        ("run.csv", "0.050,", "0.051,", 1),
    ],
)
def test_other_content_is_another_simulation(folder, file, before, after, expected):
    assert ran(folder, ask(0.5))[0] == 1
    text = (folder / file).read_text()
    assert before in text
    (folder / file).write_text(text.replace(before, after))
    assert ran(folder, ask(0.5))[0] == expected


def test_a_damaged_or_impossible_cache_costs_time_only(folder, monkeypatch):
    first = ran(folder, ask(0.5))
    for one in (folder / "kept").iterdir():
        one.write_bytes(b"no database" * 100)
    second = ran(folder, ask(0.5))
    assert second[0] == 1
    np.testing.assert_array_equal(first[1][0], second[1][0])
    (folder / "file").write_text("")
    monkeypatch.setattr(kept, "simulations_folder", lambda: folder / "file" / "below")
    assert ran(folder, ask(0.5))[0] == 1


def test_what_is_kept_has_a_bound(folder, monkeypatch):
    ran(folder, ask(0.5))
    monkeypatch.setattr(kept, "MOST_BYTES", 1000)
    assert ran(folder, ask(0.5))[0] == 1


def test_nothing_is_kept_where_it_is_not_wanted(folder):
    assert ran(folder, ask(0.5), keeps=False)[0] == 1
    assert not (folder / "kept").exists()


def test_more_simulations_than_allowed_are_refused(folder):
    loaded = load_simulator(folder / "model.yaml", [folder / "run.csv"])
    with Runs(loaded, 0, most=2) as runs:
        runs([ask(0.5), ask(0.4)])
        with pytest.raises(BudgetSpentError, match="2 of 2 simulations are spent"):
            runs([ask(0.3)])
        runs([ask(0.5)])  # it is known


def test_without_a_number_it_is_the_time_that_is_limited(folder, monkeypatch):
    loaded = load_simulator(folder / "model.yaml", [folder / "run.csv"])
    with Runs(loaded, 0) as runs:
        runs.allow([ask(0.5)])
        runs([ask(0.4)])
        monkeypatch.setattr("dbbstation.simulators.running.MOST_SECONDS", 0.0)
        with pytest.raises(BudgetSpentError, match="minutes of simulations are spent"):
            runs([ask(0.3)])
