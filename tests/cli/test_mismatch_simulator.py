"""`mismatch --simulator`: what is printed and written, and what is refused with its reason."""

import json
import math
import runpy

import numpy as np
import pytest

from dbbstation.files.places import shipped_folder
from tests.cli.test_schemas_of_results import faults
from tests.once import OF_TABLES, computed_once

FOLDER = shipped_folder("fixtures") / "simulators"
ASKED = ("mismatch", FOLDER / "pendulum.csv", "--simulator", FOLDER / "pendulum.yaml")

YAML = """format: dbb-simulator/1
name: decay
python: decay.py
time: t_s
parameters:
  rate: {value: 0.4, unit: 1/s, low: 0.1, high: 2}
states:
  level: {value: 1.0, unit: m}
outputs:
  level: {column: level_m, unit: m}
ports:
  flow: {unit: m/s, signals: {level: m}}
time_limit_s: 0.5
"""
PYTHON = """import time
import numpy as np
from dbbstation.diagnosis.simulator.contract import Simulator


class Decay(Simulator):
    def simulate(self, inputs, parameters, ports):
        t, level, found = inputs["t"], parameters["level"], []
        FAULT
        for k in range(len(t)):
            found.append(level)
            step = t[min(k + 1, len(t) - 1)] - t[k]
            level += step * (ports.flow(t[k], {"level": level}) - parameters["rate"] * level)
        return {"level": np.array(found)}
"""


@pytest.fixture(autouse=True)
def kept(tmp_path, monkeypatch):
    monkeypatch.setattr("dbbstation.simulators.kept.simulations_folder", lambda: tmp_path / "kept")
    return tmp_path / "kept"


@pytest.fixture
def decay(tmp_path):
    def make(fault="pass"):
        (tmp_path / "model.yaml").write_text(YAML)
        (tmp_path / "decay.py").write_text(PYTHON.replace("FAULT", fault))
        t = np.arange(100) * 0.05
        levels = 2.0 * np.exp(-0.5 * t) + 0.001 * np.random.default_rng(1).standard_normal(100)
        rows = "\n".join(f"{a:.3f},{b:.6f}" for a, b in zip(t, levels, strict=True))
        (tmp_path / "run.csv").write_text(f"t_s,level_m\n{rows}\n")
        return ("mismatch", tmp_path / "run.csv", "--simulator", tmp_path / "model.yaml", "--no-held-out", "--allow")

    return make


@pytest.mark.slow
@pytest.mark.usefixtures("answers_kept")
def test_the_drag_of_the_example_is_found_and_written(run, tmp_path):
    out, corrected, figure = (tmp_path / name for name in ("missing.py", "corrected.csv", "figure.svg"))
    outcome = run(*ASKED, "--no-held-out", "--json", "--out", out, "--table", corrected, "--figure", figure)
    assert outcome.code == 0, outcome.err
    (found,) = [f for f in outcome.data["findings"] if f["verdict"] == "identified"]
    assert found["name"] == "quadratic drag of speed at shaft"
    value = found["values"]["coefficient"]
    assert value["value"] == pytest.approx(-0.0012, abs=3.0 * value["uncertainty"])
    assert outcome.data["held_out"] == "not-tested"
    damping = next(p for p in outcome.data["parameters"] if p["name"] == "damping")
    assert damping["corrected"]["value"] == pytest.approx(0.008, abs=0.0005)
    assert damping["refitted"]["value"] > 0.012

    # The term as code does what was found.
    term = runpy.run_path(str(out))["shaft_quadratic_drag_of_speed"]
    assert term(0.0, {"speed": -3.0}) == pytest.approx(-9.0 * value["value"], rel=1e-6)

    table = np.genfromtxt(corrected, delimiter=",", names=True)
    left = table["angle_measured"] - table["angle_corrected"]
    assert math.sqrt(np.mean(left**2)) == pytest.approx(outcome.data["rms"]["corrected"], rel=1e-3)
    assert figure.read_text(encoding="utf-8").startswith("<?xml")


def test_how_many_simulations_are_allowed_is_said_beforehand_and_where_it_ended(run, decay):
    outcome = run(*decay(), "--most-runs", "60")
    assert "60 are allowed at the most" in outcome.err
    assert outcome.code != 0 or "Ended early" in outcome.out
    assert "60" in outcome.out + outcome.err


def test_where_simulations_are_spent_what_would_come_next_is_a_mismatch_without_a_verdict(
    run, tmp_path, tmp_path_factory, monkeypatch
):
    computed_once(tmp_path_factory, monkeypatch, *OF_TABLES)
    figure = tmp_path / "figure.svg"
    outcome = run(*ASKED, "--most-runs", "400", "--json", "--figure", figure)
    assert outcome.code == 0, outcome.err
    assert outcome.data["stopped"]
    assert outcome.data["mismatch"] is True
    assert outcome.data["findings"][0]["verdict"] == "ambiguous"
    assert figure.exists()
    told = run(*ASKED, "--most-runs", "400")
    assert told.out.startswith("Ended early: ")
    assert "No mismatch" not in told.out


def test_a_simulator_that_lacks_nothing_is_told_so(run, decay):
    outcome = run(*decay())
    assert outcome.code == 0, outcome.err
    assert "No mismatch" in outcome.out
    assert "identified" not in outcome.out


def test_a_simulation_that_fails_is_refused_with_its_line_and_input(run, decay):
    outcome = run(*decay("if parameters['rate'] != 0.4: raise RuntimeError('no water')"))
    assert outcome.code == 1
    assert "decay.py:9" in outcome.err
    assert "no water" in outcome.err
    assert "rate = " in outcome.err


def test_a_simulation_that_takes_too_long_is_refused_with_its_input(run, decay, monkeypatch):
    monkeypatch.setattr("dbbstation.simulators.running.STARTING_S", 5.0)
    outcome = run(*decay("time.sleep(30)"))
    assert outcome.code == 1
    assert "takes longer than 0.5 s" in outcome.err
    assert "rate = 0.4" in outcome.err


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--measured", "level_m"), "--measured cannot be combined with --simulator"),
        (("--most-runs", "0"), "most-runs"),
    ],
)
def test_options_of_tables_are_refused(run, decay, more, said):
    outcome = run(*decay(), *more)
    assert outcome.code == 2
    assert said in outcome.err


def test_tables_need_their_columns(run, decay):
    asked = decay()
    outcome = run(*asked[:2])
    assert outcome.code == 2
    assert "--measured and --simulated" in outcome.err


def test_a_time_that_goes_back_is_refused_with_its_line(run, decay, tmp_path):
    asked = decay()
    lines = (tmp_path / "run.csv").read_text().splitlines()
    lines[5], lines[6] = lines[6], lines[5]
    (tmp_path / "run.csv").write_text("\n".join(lines) + "\n")
    outcome = run(*asked)
    assert outcome.code == 1
    assert "run.csv:7" in outcome.err
    assert "does not rise" in outcome.err


def test_the_help_names_the_simulator(run):
    assert "--simulator" in run("mismatch", "--help").out


def test_json_is_what_its_schema_says_and_simulations_are_run_once_only(run, decay):
    asked = (*decay(), "--json")
    first = run(*asked).data
    assert first["simulator"] == "decay"
    schema = json.loads(run("check", "--schema", "mismatch-simulator").out)
    assert faults(first, schema, schema.get("$defs", {})) == []
    assert first["simulations"]["kept"] == 0

    second = run(*asked).data
    assert second["simulations"]["run"] < 0.1 * first["simulations"]["run"]
    assert second["simulations"]["kept"] > 0.9 * first["simulations"]["run"]
    assert second["findings"] == first["findings"]
    assert second["parameters"] == first["parameters"]


OUTLET = """from dbbstation.own import Parameter, PortSource


class Outlet(PortSource):
    name = "outlet"
    port = "flow"

    def parameters(self):
        return (Parameter("size", "m^0.5/s", 0.3, "outflow by the root of the level"),)

    def value(self, t, signals, parameters):
        return -parameters["size"] * max(signals["level"], 0.0) ** 0.5
"""


def test_physics_of_ones_own_competes_at_its_port(run, decay, tmp_path):
    """Level of a tank with a hole: closed form of dl/dt = -r l - c √l [by √l], rate 0.4 and 0.3."""
    asked = decay()
    t = np.arange(200) * 0.02
    root = (np.sqrt(2.0) + 0.75) * np.exp(-0.2 * t) - 0.75  # d√l/dt = -(r √l + c) / 2
    levels = np.square(root) + 0.001 * np.random.default_rng(2).standard_normal(len(t))
    rows = "\n".join(f"{a:.3f},{b:.6f}" for a, b in zip(t, levels, strict=True))
    (tmp_path / "run.csv").write_text(f"t_s,level_m\n{rows}\n")
    (tmp_path / "outlet.py").write_text(OUTLET)
    out = tmp_path / "missing.py"
    outcome = run(*asked, "--source-files", tmp_path / "outlet.py", "--json", "--out", out)
    assert outcome.code == 0, outcome.err
    (found,) = [f for f in outcome.data["findings"] if f["name"].startswith("outlet")]
    assert found["verdict"] == "identified"
    levels = outcome.data["levels"]
    assert levels["differs"]["answer"] == "yes"
    (followed,) = (one for one in levels["follows"] if found["name"] in one["members"])
    assert followed["variables"] == [["port flow"]]
    assert followed["answer"] == "not tested" if outcome.data["held_out"] == "not-tested" else "follows"
    # The simulator's Euler steps of 20 ms are off by about a hundredth.
    assert found["values"]["size"]["value"] == pytest.approx(0.3, rel=0.015)
    # The term as code runs where it is pasted: outflow by the root of a level of 4 m.
    (function,) = [value for name, value in runpy.run_path(str(out)).items() if name.startswith("flow_outlet")]
    assert function(0.0, {"level": 4.0}) == pytest.approx(-2.0 * found["values"]["size"]["value"], rel=1e-9)


@pytest.mark.parametrize(
    ("fault", "line", "said"),
    [
        (('"m^0.5/s", 0.3, "outflow by the root of the level"', '"m^0.5/s"'), 9, "TypeError"),
        (('signals["level"]', 'signals["height"]'), 12, "height"),
        (('port = "flow"', 'port = "tap"'), 4, "no port"),
    ],
)
def test_a_fault_of_ones_own_physics_is_told_with_its_line(run, decay, tmp_path, fault, line, said):
    asked = decay()
    (tmp_path / "outlet.py").write_text(OUTLET.replace(*fault))
    outcome = run(*asked, "--source-files", tmp_path / "outlet.py")
    assert outcome.code == 1
    assert f"outlet.py:{line}" in outcome.err
    assert said in outcome.err
