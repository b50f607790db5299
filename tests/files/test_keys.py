"""What is kept between commands is known by all that decides it: each input and each part of a key is changed."""

from __future__ import annotations

import shutil
from dataclasses import fields, replace
from pathlib import Path

import pytest

from dbbstation.errors import InputError, Problem
from dbbstation.files import keys
from dbbstation.files.formats.settings import Settings
from dbbstation.files.formats.simulator import parse_simulator
from dbbstation.files.keys import key_of
from dbbstation.history.trend import TrendOptions
from dbbstation.plan.tolerance import CircleFigure, Tolerance
from dbbstation.service.after import counted
from dbbstation.simulators.loading import LoadedSimulator
from dbbstation.tasks import fleet as fleet_module
from dbbstation.tasks.fleet_work import FleetOptions
from dbbstation.tasks.histories import histories_in
from dbbstation.tasks.telling import StoppedError
from tests.simulators.test_program import PROGRAM, YAML

SMALL = Path("fixtures/sessions/small").absolute()

DECIDING = ("session.yaml", "machine.yaml", "plan.yaml", "runs/a-ccw-1.csv")


@pytest.fixture
def session(tmp_path: Path) -> Path:
    return Path(shutil.copytree(SMALL, tmp_path / "sessions" / "one"))


def change(path: Path) -> None:
    path.write_text("# another\n" + path.read_text("utf-8"), encoding="utf-8")


@pytest.mark.parametrize(
    ("request_", "inputs"),
    [
        ({"task": "other"}, [("a", "1"), ("b", "2")]),
        ({"task": "one", "more": 1}, [("a", "1"), ("b", "2")]),
        ({"task": "one"}, [("a", "1"), ("b", "3")]),
        ({"task": "one"}, [("a", "1"), ("c", "2")]),
        ({"task": "one"}, [("a", "1")]),
        ({"task": "one"}, [("a", "2"), ("b", "1")]),
    ],
)
def test_another_request_or_file_has_another_key(request_, inputs):
    assert key_of(request_, inputs) != key_of({"task": "one"}, [("b", "2"), ("a", "1")])


def test_another_program_has_another_key(monkeypatch):
    before = key_of({"task": "one"})
    monkeypatch.setattr(keys, "program_identity", lambda: {"code": "another"})
    assert key_of({"task": "one"}) != before


@pytest.mark.parametrize("name", DECIDING)
def test_results_of_a_session_are_of_all_its_files(session, name):
    before = counted(session)
    assert counted(session) == before
    change(session / name)
    assert _or_refused(session) != before


def _or_refused(session: Path) -> str:
    try:
        return counted(session)
    except InputError as error:
        return str(error)


@pytest.mark.parametrize("name", DECIDING[1:])
def test_a_history_reads_a_session_again_whose_files_changed(session, name, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def read() -> int:
        return histories_in(session.parent, TrendOptions(coverage_factor=2.0)).worked_out

    assert (read(), read()) == (1, 0)
    change(session / name)
    if name.startswith("runs/"):
        with pytest.raises(InputError, match="none of its 1 sessions can be used"):
            read()
    else:
        assert (read(), read()) == (1, 0)


def test_a_history_reads_a_model_again_that_changed_or_whose_causes_did(session, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    own = Path(shutil.copy("fixtures/sources/scale_bow.py", tmp_path / "own.py"))
    model = Path(shutil.copy("fixtures/models/small.yaml", session.parent / "model.yaml"))

    def read() -> int:
        return histories_in(session.parent, TrendOptions(coverage_factor=2.0), source_files=[own]).worked_out

    assert (read(), read()) == (2, 0)
    for path in (model, own):
        with path.open("a", encoding="utf-8") as file:
            file.write("\n# another\n")
        assert (read(), read()) == (1, 0)


def fleet_key(session: Path, task: str, options: FleetOptions, monkeypatch: pytest.MonkeyPatch) -> str:
    """By what the result of a session would be known; nothing is done."""
    known: list[str] = []

    def noted(request: dict[str, object], inputs: list[tuple[str, str]]) -> str:
        known.append(key_of(request, inputs))
        return known[-1]

    with monkeypatch.context() as patched:
        patched.setattr(fleet_module, "key_of", noted)
        with pytest.raises(StoppedError):
            fleet_module.fleet(
                [session.parent], task, session.parent.parent / "out", options=options, stop=lambda: True
            )
    return " ".join(known)  # none where a file of the session is not as the session says: nothing is done with it


@pytest.mark.parametrize("name", DECIDING)
def test_a_result_of_a_fleet_is_of_all_files_of_its_session(session, name, monkeypatch):
    before = fleet_key(session, "circles", FleetOptions(), monkeypatch)
    assert fleet_key(session, "circles", FleetOptions(), monkeypatch) == before
    with (session / name).open("a", encoding="utf-8") as file:  # the first line of the session names its format
        file.write("# another\n")
    assert fleet_key(session, "circles", FleetOptions(), monkeypatch) != before


def test_a_result_of_a_fleet_is_of_its_task_and_of_every_option(session, monkeypatch, tmp_path):
    own = Path(shutil.copy("fixtures/sources/scale_bow.py", tmp_path / "own.py"))
    others = {
        "given": {"tests": ("a",)},
        "source_files": (own,),
        "settings": Settings(tolerances_from="shop.yaml:3"),
    }
    assert {field.name for field in fields(FleetOptions)} == set(others)
    found = [fleet_key(session, task, FleetOptions(), monkeypatch) for task in ("circles", "calibrate")]
    limit = Settings(tolerances=(Tolerance(CircleFigure.CIRCULAR_DEVIATION, 20.0),))
    found.append(fleet_key(session, "circles", FleetOptions(settings=limit), monkeypatch))
    for name, other in others.items():
        found.append(fleet_key(session, "circles", replace(FleetOptions(), **{name: other}), monkeypatch))
    further = ({"findings": True}, {"exclude": ("a",)}, {"tests": ("b",)})
    found += [fleet_key(session, "circles", FleetOptions(given), monkeypatch) for given in further]
    change(own)
    found.append(fleet_key(session, "circles", FleetOptions(source_files=(own,)), monkeypatch))
    assert len(set(found)) == len(found)


@pytest.fixture
def simulator(tmp_path: Path) -> Path:
    (tmp_path / "tank.py").write_text(PROGRAM)
    (tmp_path / "late").mkdir()
    (tmp_path / "late" / "__init__.py").write_text("")
    return tmp_path


def content(folder: Path, text: str) -> str:
    path = folder / "model.yaml"
    path.write_text(text)
    faults: list[Problem] = []
    file = parse_simulator(path, faults)
    assert file is not None, faults
    return LoadedSimulator(path, path, file, None, (), ()).content  # type: ignore[arg-type]  # nothing is simulated


def test_a_simulation_is_of_the_arguments_of_its_program(simulator):
    assert content(simulator, YAML) != content(simulator, YAML.replace("tank.py]", "tank.py, --fine]"))


def test_a_simulation_is_of_modules_that_are_imported_late(simulator):
    text = "\n".join("python: tank.py" if line.startswith("program") else line for line in YAML.splitlines())
    text = text.replace("time_limit_s: 20", "")
    (simulator / "tank.py").write_text(
        "from dbbstation.own import Simulator\nclass Tank(Simulator):\n    def simulate(self, inputs, parameters, ports):\n        ports.flow(0.0, {})\n"
    )
    before = content(simulator, text)
    for name in ("helper.py", "late/deep.py"):
        (simulator / name).write_text("x = 1\n")
        after = content(simulator, text)
        assert after != before
        before = after


def test_a_simulation_is_of_the_variables_of_its_fmu(simulator):
    (simulator / "tank.fmu").write_bytes(b"PK")
    text = "\n".join("fmu: tank.fmu" if line.startswith("program") else line for line in YAML.splitlines())
    one, other = (content(simulator, f"{text}\nvariables: {{level: {name}}}\n") for name in ("h", "x"))
    assert one != other
