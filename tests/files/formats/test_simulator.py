"""`dbb-simulator/1`: what is refused, and in which line."""

import pytest

from dbbstation.files.formats.simulator import parse_simulator

YAML = """format: dbb-simulator/1
name: mass
python: mass.py
time: t_s
inputs: {force: force_n}
parameters:
  mass: {value: 1.0, unit: kg, low: 0.1, high: 10}
outputs:
  place: {column: place_m, unit: m}
ports:
  push: {unit: N, signals: {speed: m/s}}
"""
PYTHON = """from dbbstation.diagnosis.simulator.contract import Simulator


class Mass(Simulator):
    def simulate(self, inputs, parameters, ports):
        return {"place": [ports.push(t, {"speed": 0.0}) for t in inputs["t"]]}
"""


def faults_of(tmp_path, yaml=YAML, python=PYTHON):
    (tmp_path / "model.yaml").write_text(yaml)
    (tmp_path / "mass.py").write_text(python)
    faults = []
    found = parse_simulator(tmp_path / "model.yaml", faults)
    assert (found is None) == bool(faults)
    return [(fault.file.rpartition("/")[2], fault.line, fault.what) for fault in faults]


def test_a_good_one_has_no_faults(tmp_path):
    assert faults_of(tmp_path) == []


def test_a_signal_may_be_a_result(tmp_path):
    (tmp_path / "mass.py").write_text(PYTHON)
    marked = "signals: {speed: m/s, torque: {unit: N m, result: true}, angle: {unit: rad}}"
    (tmp_path / "model.yaml").write_text(YAML.replace("signals: {speed: m/s}", marked))
    port = parse_simulator(tmp_path / "model.yaml", []).ports["push"]
    assert port.units == {"speed": "m/s", "torque": "N m", "angle": "rad"}
    assert port.results == {"torque"}


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("value: 1.0", "value: 11.0", 7, "outside the bounds"),
        ("low: 0.1, high: 10", "low: 10, high: 0.1", 7, "not below"),
        ("python: mass.py", "python: other.py", 3, "cannot be read"),
        ("uncertainty: 1", "uncertainty: -1", 7, "uncertainty"),
        ("ports:", "portz:", 10, "portz"),
        ("mass: {value", "7mass: {value", 7, "7mass"),
        ("{speed: m/s}", "{speed: {unit: m/s, reslt: true}}", 11, "reslt"),
    ],
)
def test_what_is_wrong_in_the_file_is_said_with_its_line(tmp_path, old, new, line, said):
    found = faults_of(tmp_path, yaml=YAML.replace("unit: kg,", "unit: kg, uncertainty: 1,").replace(old, new))
    assert any(said in what and at == line for _, at, what in found), found


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("signals: {speed: m/s}", "signals: {t: s}", "already means the time"),
        ("inputs: {force: force_n}", "inputs: {t: force_n}", "the input `t`"),
        ("inputs: {", "states: {mass: {value: 1.0}}\ninputs: {", "is both a parameter and a state"),
    ],
)
def test_names_that_are_taken_are_refused(tmp_path, old, new, said):
    assert any(said in what for _, _, what in faults_of(tmp_path, yaml=YAML.replace(old, new)))


@pytest.mark.parametrize(
    ("old", "new", "line", "said"),
    [
        ("ports.push(", "ports.pull(", 6, "`ports.pull` is no port"),
        ("(Simulator)", "(object)", 0, "no class derives"),
        ("def simulate(self, inputs, parameters, ports)", "def simulate(self, inputs, ports)", 5, "simulate"),
        ("def simulate", "def simulates", 4, "is not there"),
        ("class Mass", "clas Mass", 4, "is not Python"),
    ],
)
def test_what_is_wrong_in_the_program_is_said_with_its_line(tmp_path, old, new, line, said):
    found = faults_of(tmp_path, python=PYTHON.replace(old, new))
    assert any(file == "mass.py" and at == line and said in what for file, at, what in found), found


def test_a_port_that_is_never_called_is_said(tmp_path):
    found = faults_of(tmp_path, python=PYTHON.replace('ports.push(t, {"speed": 0.0})', "0.0"))
    assert found == [("model.yaml", 11, "port `push` is never called in mass.py")]


def test_the_program_is_not_executed(tmp_path):
    assert faults_of(tmp_path, python=PYTHON + "\nraise SystemExit\n") == []
