"""A source of one's own from a Python file: simulated, named by the diagnosis, used by everything that reads the model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

from dbbstation.cli import FAILED
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.model import write_model
from dbbstation.files.own_sources import every_source
from dbbstation.files.places import shipped_folder
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.sources.contract import Fitted
from dbbstation.tasks.load import load_sessions
from tests.plant.mechanisms.base import Mechanism
from tests.plant.plan import subset, table_ii_plan
from tests.plant.session import record, true_runs

EXAMPLE = shipped_folder("fixtures") / "sources" / "scale_bow.py"
PLANS = shipped_folder("protocols") / "plans"
BOW_UM = np.array([0.0, 30.0, 0.0, 0.0, -20.0, 0.0])


@dataclass(frozen=True)
class BowedScales(Mechanism):
    """Struts longer by a parabola of their travel, as the example says, in the independent virtual machine."""

    name: ClassVar[str] = "bowed-scales"
    listed: ClassVar[bool] = False

    def driven_mm(self, motion, driven_mm):
        del motion
        return 1e-3 * BOW_UM * ((driven_mm - 840.0) / 540.0) ** 2  # travel of the reference machine: 300 to 1380 mm


@pytest.fixture(scope="module", params=["abdhjk", pytest.param("abcdefghijklmno", marks=pytest.mark.nightly)])
def bowed(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bowed") / "session"
    record(folder, seed=41, plan=subset(table_ii_plan(41), request.param), mechanisms=[BowedScales()], rate_hz=4.0)
    return folder


@pytest.fixture(scope="module")
def truth(tmp_path_factory):
    machine = read_machine(shipped_folder("fixtures") / "machines" / "reference.yaml")
    source = every_source([EXAMPLE])["scale-bow"]
    path = tmp_path_factory.mktemp("truth") / "truth.yaml"
    write_model(path, IdentifiedModel(MachineModel(machine, (Fitted(source, BOW_UM),)), (), np.zeros((0, 0))))
    return path


def test_it_is_simulated_as_the_independent_machine_moves(truth, run, tmp_path):
    line = ("simulate", "--model", truth, PLANS / "table2.yaml", "--out", tmp_path / "s")
    refused = run(*line)
    assert refused.code == FAILED
    assert "no error source is called `scale-bow`" in refused.err
    assert "one of your own is given with --source-files FILE.py, or its package installed" in refused.err
    done = run(*line, "--source-files", EXAMPLE)
    assert done.code == 0, done.err
    simulated = load_sessions([tmp_path / "s"])
    true = {f"{r.slot.test.name}-{r.slot.direction}": r for r in true_runs(table_ii_plan(1), [BowedScales()])}
    for observation in simulated.observations:
        independent = true[f"{observation.test}-{observation.raw.circle.direction}"]
        kept = independent.in_circle
        there = np.interp(
            np.sort(independent.theta_deg[kept] % 360.0),
            np.sort(observation.raw.theta_deg % 360.0),
            observation.raw.length_mm[np.argsort(observation.raw.theta_deg % 360.0)],
        )
        by_angle = independent.length_mm[kept][np.argsort(independent.theta_deg[kept] % 360.0)]
        assert np.ptp(there - by_angle) < 2e-4


@pytest.mark.slow
def test_the_diagnosis_names_it_and_the_joint_model_is_read_with_its_file(bowed, run, tmp_path):
    session = bowed
    joint = tmp_path / "joint.yaml"
    asked = ("--sources", "gravity,backlash,screw-lead,scale-bow")
    found = run("diagnose", session, "--source-files", EXAMPLE, *asked, "--no-held-out", "--out", joint, "--json")
    assert found.code == 0, found.err
    (first, *_) = found.data["sources"]
    assert (first["name"], first["verdict"]) == ("scale-bow", "identified")
    values = [number["value"] for number in first["parameters"].values()]
    sigma = [number["uncertainty"] for number in first["parameters"].values()]
    assert np.all(np.abs(values - BOW_UM) < 4 * np.array(sigma) + 0.5)
    poses = tmp_path / "poses.csv"
    poses.write_text("x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,-1008,0,0,0\n50,20,-1100,5,0,0\n", encoding="utf-8")
    with_model = ("predict", "--model", joint, poses, "--table", tmp_path / "actual.csv")
    assert "--source-files" in run(*with_model).err
    assert run(*with_model, "--source-files", EXAMPLE).code == 0


@pytest.mark.parametrize("command", ["check", "evaluate", "program", "compensate"])
def test_whatever_reads_a_model_says_what_is_missing_and_takes_the_file(bowed, truth, run, tmp_path, command):
    session, model = bowed, truth
    program = tmp_path / "part.ngc"
    program.write_text("G21 G90\nG0 X0 Y0 Z-1008 A0 B0 C0\nG1 X20 F1000\nM2\n", encoding="utf-8")
    plan = PLANS / "table2.yaml"
    machine = shipped_folder("fixtures") / "machines" / "reference.yaml"
    line = {
        "check": ("check", model),
        "evaluate": ("evaluate", session, "--model", model),
        "program": (
            "program",
            "--plan",
            plan,
            "--machine",
            machine,
            "--model",
            model,
            "--tests",
            "a",
            "--step-deg",
            "5",
        ),
        "compensate": ("compensate", program, "--model", model, "--prefer", "accuracy"),
    }[command]
    out = {"program": ("--out", tmp_path / "out"), "compensate": ("--out", tmp_path / "out.ngc")}.get(command, ())
    refused = run(*line, *out)
    assert refused.code == FAILED
    assert "--source-files" in refused.err
    taken = run(*line, *out, "--source-files", EXAMPLE)
    assert taken.code == 0, taken.err


def test_calibrate_fits_it_where_it_is_named(bowed, run):
    session = bowed
    sources = "strut-reference-length,base-joints,scale-bow"
    fitted = run("calibrate", session, "--source-files", EXAMPLE, "--sources", sources, "--json")
    assert fitted.code == 0, fitted.err
    (bow,) = [source for source in fitted.data["sources"] if source["name"] == "scale-bow"]
    values = np.array([number["value"] for number in bow["parameters"].values()])
    sigma = np.array([number["uncertainty"] for number in bow["parameters"].values()])
    assert np.abs(values - BOW_UM).max() < 4.0 * sigma.max()
    assert "scale-bow is known now, but not fitted" in run("calibrate", session, "--source-files", EXAMPLE).err
    unknown = run("calibrate", session, "--sources", sources)
    assert unknown.code == FAILED
    assert "--source-files" in unknown.err
