"""An FMU as a simulator, of FMI 2 and of FMI 3: the test compiles both; with a concealed effect, end to end."""

import contextlib
import json
import os
import re
import shutil
import subprocess
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest

from dbbstation.diagnosis.simulator.model import SimulationRequest
from dbbstation.diagnosis.simulator.terms import Term, TermForm
from dbbstation.errors import CalibrationError, InputError
from dbbstation.simulators import fmu as fmu_module
from dbbstation.simulators import kept
from dbbstation.simulators.loading import load_simulator
from dbbstation.simulators.running import Runs
from tests.cli.conftest import call
from tests.diagnosis.simulator.systems import held

fmpy = pytest.importorskip("fmpy", reason="FMPy, an extra, is not installed")
resource = pytest.importorskip("resource", reason="Windows does not say how much memory was taken")
if shutil.which("gcc") is None:
    pytest.skip("no gcc to compile an FMU", allow_module_level=True)

# FMPy leaves archives open whose description is none.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")

HERE = Path(__file__).parent
DESCRIPTION_2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="tank" guid="{tank}">
  <CoSimulation modelIdentifier="tank" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="rate" valueReference="0" causality="parameter" variability="tunable"><Real start="0.4"/></ScalarVariable>
    <ScalarVariable name="inflow" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="flow" valueReference="2" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="level" valueReference="3" causality="output"><Real/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="4"/></Outputs></ModelStructure>
</fmiModelDescription>
"""
DESCRIPTION_3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="tank" instantiationToken="{tank}">
  <CoSimulation modelIdentifier="tank" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <Float64 name="time" valueReference="9" causality="independent" variability="continuous"/>
    <Float64 name="rate" valueReference="0" causality="parameter" variability="tunable" start="0.4"/>
    <Float64 name="inflow" valueReference="1" causality="input" start="0"/>
    <Float64 name="flow" valueReference="2" causality="input" start="0"/>
    <Float64 name="level" valueReference="3" causality="output"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="3"/></ModelStructure>
</fmiModelDescription>
"""
# Of each version of FMI: description, source, and where the standard has its library.
VERSIONS = {
    "FMI 2": (DESCRIPTION_2, "tank.c", "binaries/linux64/tank.so"),
    "FMI 3": (DESCRIPTION_3, "tank3.c", "binaries/x86_64-linux/tank.so"),
}
T = 0.25 * np.arange(160)


@pytest.fixture(scope="module", params=VERSIONS)
def fmu(request, tmp_path_factory):
    description, source, place = VERSIONS[request.param]
    folder = tmp_path_factory.mktemp("fmu")
    library = folder / "tank.so"
    headers = Path(fmpy.__file__).parent / "c-code"
    # FMPy asks for every function of FMI 3, also for those that no tank needs.
    named = set(re.findall(r"\bfmi3\w+", (HERE / source).read_text()))
    every = re.findall(r"FMI3_Export fmi3\w+TYPE +(fmi3\w+);", (headers / "fmi3Functions.h").read_text())
    (folder / "others.c").write_text(
        "".join(f"int {name}(void) {{ return 3; }}\n" for name in every if name not in named)
    )
    subprocess.run(
        ["gcc", "-shared", "-fPIC", "-O1", f"-I{headers}", HERE / source, folder / "others.c", "-o", library, "-lm"],  # noqa: S607 - the compiler on the PATH
        check=True,
    )
    with zipfile.ZipFile(folder / "tank.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, place)
    return folder / "tank.fmu"


@pytest.fixture
def folder(fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(kept, "simulations_folder", lambda: tmp_path / "kept")
    shutil.copy(fmu, tmp_path)
    shutil.copy(HERE / "tank-fmu.yaml", tmp_path / "model.yaml")
    rng = np.random.default_rng(4)
    pump = 0.5 + held(rng, len(T), 16, 0.4)
    level, levels = 1.0, []
    for u in pump:  # the truth loses 0.08 x² as well, held for a row
        levels.append(level)
        drive = (u - 0.08 * level * level) / 0.4
        level = drive + (level - drive) * np.exp(-0.4 * 0.25)
    rows = np.array(levels) + 0.002 * rng.standard_normal(len(T))
    lines = "\n".join(f"{t:.2f},{u:.4f},{x:.5f}" for t, u, x in zip(T, pump, rows, strict=True))
    (tmp_path / "run.csv").write_text(f"t_s,pump,level_m\n{lines}\n")
    return tmp_path


def simulated(folder, rate, *terms):
    loaded = load_simulator(folder / "model.yaml", [folder / "run.csv"])
    with Runs(loaded, 0) as runs:
        return loaded, runs([SimulationRequest(0, (("rate", rate),), terms)])[0].outputs[0]


def test_an_fmu_is_simulated_with_its_parameters_and_inputs(folder):
    loaded, found = simulated(folder, 0.3)
    level, expected = 1.0, []
    for u in loaded.model.runs[0].inputs["pump"].tolist():
        expected.append(level)
        level = u / 0.3 + (level - u / 0.3) * np.exp(-0.3 * 0.25)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_term_follows_the_state_of_an_fmu_by_rounds(folder):
    loaded, found = simulated(folder, 0.3, Term("flow", TermForm.SQUARE, ("level",), (-0.08,)))
    level, expected = 1.0, []
    for u in loaded.model.runs[0].inputs["pump"].tolist():
        expected.append(level)
        drive = (u - 0.08 * level * level) / 0.3
        level = drive + (level - drive) * np.exp(-0.3 * 0.25)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_variable_that_an_fmu_lacks_is_refused_with_its_name(folder):
    text = (folder / "model.yaml").read_text()
    (folder / "model.yaml").write_text(text.replace("flow.level: level", "flow.level: depth"))
    with pytest.raises(CalibrationError, match="depth"):
        simulated(folder, 0.3)
    (folder / "model.yaml").write_text(text.replace("tank.fmu", "other.fmu"))
    with pytest.raises(InputError, match=r"`other\.fmu` is not there"):
        simulated(folder, 0.3)


@pytest.mark.nightly
def test_what_an_fmu_lacks_is_found_end_to_end(folder):
    asked = ("mismatch", folder / "run.csv", "--simulator", folder / "model.yaml", "--no-held-out", "--json", "--allow")
    outcome = call(*asked)
    assert outcome.code == 0, outcome.err
    data = json.loads(outcome.out)
    there = [f for f in data["findings"] if f["verdict"] == "identified"]
    assert [f["port"] for f in there] == ["flow"]
    rate = next(p for p in data["parameters"] if p["name"] == "rate")
    assert rate["corrected"]["value"] == pytest.approx(0.4, abs=0.05)


def rewritten(path, changes):
    """Replace or add members of an archive."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()} | changes
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


ENTITIES = "".join(f'<!ENTITY {name} "{f"&{of};" * 100}">' for of, name in zip("abcd", "bcde", strict=True))
HOSTILE = {
    "entities that grow to 1e11 letters": f'<!DOCTYPE x [<!ENTITY a "{"a" * 1000}">{ENTITIES}]><fmiModelDescription modelName="&e;"/>',
    "another file": '<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><fmiModelDescription>&a;</fmiModelDescription>',
    "a deep nest": "<a>" * 100_000 + "</a>" * 100_000,
    "no XML": "\xff\0",
    "nothing": "",
}


@pytest.mark.parametrize("what", HOSTILE)
def test_a_hostile_description_is_one_sentence_without_what_it_asked_for(folder, what):
    rewritten(folder / "tank.fmu", {"modelDescription.xml": HOSTILE[what]})
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(CalibrationError, match="the simulation failed") as caught:
        simulated(folder, 0.3)
    assert "root:" not in str(caught.value)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < 200e6


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [
        ("resources/zeros", b"\0" * 2_000_001, r"unpacks to 2 MB, at most 2 MB are unpacked"),
        ("modelDescription.xml", b" " * 1_500_000, r"unpacks to 2 MB, at most 1 MB are unpacked"),
        ("many", 30, r"holds \d+ files, at most 20 are unpacked"),
    ],
)
def test_an_archive_that_would_unpack_to_too_much_is_refused_before(folder, monkeypatch, name, content, fault):
    monkeypatch.setattr(fmu_module, "MOST_UNPACKED_MB", 2.0)
    monkeypatch.setattr(fmu_module, "MOST_DESCRIBED_MB", 1.0)
    monkeypatch.setattr(fmu_module, "MOST_FILES", 20)
    changes = {name: content} if isinstance(content, bytes) else {f"{name}/{k}": b"" for k in range(content)}
    rewritten(folder / "tank.fmu", changes)
    with pytest.raises(InputError, match=fault):
        simulated(folder, 0.3)


@pytest.mark.parametrize("data", [b"", b"no archive", b"PK\x03\x04" + bytes(200), "cut"])
def test_what_is_no_archive_is_refused(folder, data):
    whole = (folder / "tank.fmu").read_bytes()
    (folder / "tank.fmu").write_bytes(whole[: len(whole) // 2] if data == "cut" else data)
    with pytest.raises(InputError, match="is no FMU"):
        simulated(folder, 0.3)


@pytest.mark.parametrize("way", ["../../", "/tmp/"])  # noqa: S108 - where nothing must be written
def test_nothing_is_unpacked_outside(folder, tmp_path, way):
    name = f"unpacked-outside-{os.getpid()}.txt"
    rewritten(folder / "tank.fmu", {way + name: b"x"})
    with contextlib.suppress(CalibrationError):
        simulated(folder, 0.3)
    assert not list(tmp_path.parent.rglob(name))
    assert not list(Path(tempfile.gettempdir()).glob(name))
