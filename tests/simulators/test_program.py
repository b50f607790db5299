"""A program as a simulator: CSV and JSON in, CSV out; what acts follows the state by rounds."""

import sys

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.model import SimulationRequest
from dbbstation.diagnosis.simulator.terms import Term, TermForm
from dbbstation.errors import CalibrationError
from dbbstation.files.formats.simulator import parse_simulator
from dbbstation.files.places import shipped_folder
from dbbstation.simulators import kept
from dbbstation.simulators.loading import load_simulator
from dbbstation.simulators.running import Runs

YAML = f"""format: dbb-simulator/1
name: tank
program: [{sys.executable}, tank.py]
time: t_s
inputs: {{pump: pump}}
parameters:
  rate: {{value: 0.4, unit: 1/s, low: 0.1, high: 2}}
outputs:
  level: {{column: level_m, unit: m}}
ports:
  flow: {{unit: m/s, signals: {{level: m}}}}
time_limit_s: 20
"""

# Exact steps of dx/dt = u + f - r x with what acts held over a row: another language would do the same.
PROGRAM = """import csv, json, math
rate = json.load(open("parameters.json"))["rate"]
rows = list(csv.DictReader(open("inputs.csv")))
level, out = 1.0, []
for k, row in enumerate(rows):
    out.append(level)
    if k + 1 < len(rows):
        step = float(rows[k + 1]["t"]) - float(row["t"])
        drive = (float(row["pump"]) + float(row["flow"])) / rate
        level = drive + (level - drive) * math.exp(-rate * step)
with open("outputs.csv", "w") as file:
    print("level,flow.level", file=file)
    for x in out:
        print(f"{x!r},{x!r}", file=file)
"""
T = 0.1 * np.arange(60)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "simulations_folder", lambda: tmp_path / "kept")
    (tmp_path / "model.yaml").write_text(YAML)
    (tmp_path / "tank.py").write_text(PROGRAM)
    rows = "\n".join(f"{t:.3f},0,{1.5 + 0.1 * np.sin(t):.6f}" for t in T)
    (tmp_path / "run.csv").write_text(f"t_s,pump,level_m\n{rows}\n")
    return tmp_path


def simulated(folder, *terms, records=False):
    loaded = load_simulator(folder / "model.yaml", [folder / "run.csv"])
    with Runs(loaded, 0) as runs:
        return runs([SimulationRequest(0, (("rate", 0.4),), terms, records)])[0]


def test_a_program_is_asked_in_files(folder):
    np.testing.assert_allclose(simulated(folder).outputs[0], np.exp(-0.4 * T), rtol=1e-12)


def test_a_term_that_follows_the_state_is_found_by_rounds(folder):
    """-0.3 x held over each row: x -> (1 - 0.75) x exp(-0.04) - ... by hand, one row after the other."""
    found = simulated(folder, Term("flow", TermForm.LINEAR, ("level",), (-0.3,)))
    decay = np.exp(-0.4 * 0.1)
    factor = decay - 0.3 / 0.4 * (1.0 - decay)
    np.testing.assert_allclose(found.outputs[0], factor ** np.arange(60), rtol=1e-7)


def test_signals_at_the_port_come_back(folder):
    found = simulated(folder, records=True)
    np.testing.assert_allclose(found.signals["flow"]["level"], np.exp(-0.4 * T), rtol=1e-12)


def test_the_example_does_what_the_closed_form_does(tmp_path, monkeypatch):
    """dx/dt = 0.5 - 0.4 x from x = 1: x = 1.25 - 0.25 exp(-0.4 t)."""
    monkeypatch.setattr(kept, "simulations_folder", lambda: tmp_path / "kept")
    example = shipped_folder("fixtures") / "simulators"
    for name in ("tank.yaml", "tank_program.py"):
        (tmp_path / name).write_text((example / name).read_text().replace("python3", sys.executable))
    rows = "\n".join(f"{t:.3f},0.5,1" for t in T)
    (tmp_path / "run.csv").write_text(f"t_s,pump_m_s,level_m\n{rows}\n")
    loaded = load_simulator(tmp_path / "tank.yaml", [tmp_path / "run.csv"])
    with Runs(loaded, 0) as runs:
        (found,) = runs([SimulationRequest(0, (("outflow", 0.4), ("level", 1.0)))])
    np.testing.assert_allclose(found.outputs[0], 1.25 - 0.25 * np.exp(-0.4 * T), rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("level, out = 1.0, []", 'raise SystemExit("no water")', "code 1: no water"),
        ("level,flow.level", "level,flow.height", "no `flow.level`"),
        ("{x!r},{x!r}", "{x!r},dry", "not a number"),
        ("{x!r},{x!r}", "{x!r}", "has 1 cells"),
        ("for x in out", "for x in out[1:]", "with 60 rows"),
        ('"outputs.csv", "w"', '"other.csv", "w"', "no `outputs.csv`"),
    ],
)
def test_what_a_program_does_wrong_is_refused_with_its_input(folder, old, new, said):
    (folder / "tank.py").write_text(PROGRAM.replace(old, new))
    with pytest.raises(CalibrationError) as error:
        simulated(folder)
    assert said in str(error.value)
    assert "rate = 0.4" in str(error.value)


def test_a_program_that_is_not_there_or_does_not_end_is_refused(folder):
    (folder / "model.yaml").write_text(YAML.replace(sys.executable, "no-such-program"))
    with pytest.raises(CalibrationError, match="cannot be run"):
        simulated(folder)
    (folder / "model.yaml").write_text(YAML.replace("time_limit_s: 20", "time_limit_s: 1"))
    (folder / "tank.py").write_text("import time\ntime.sleep(60)\n")
    with pytest.raises(CalibrationError, match="takes longer than 1 s"):
        simulated(folder)


def test_another_program_is_other_content(folder):
    def content():
        return load_simulator(folder / "model.yaml", [folder / "run.csv"]).content

    before = content()
    (folder / "tank.py").write_text(PROGRAM + "# changed\n")
    assert content() != before


def test_one_kind_of_simulator_is_named(tmp_path):
    for more, line in (("python: tank.py\nprogram: [tank]", True), ("", True)):
        (tmp_path / "model.yaml").write_text(YAML.replace(f"program: [{sys.executable}, tank.py]\n", more + "\n"))
        faults = []
        assert parse_simulator(tmp_path / "model.yaml", faults) is None
        assert any("one of `python`, `program` and `fmu`" in fault.what for fault in faults) is line
