"""A circle held against where a model expects it: what the nominal machine cannot tell shows at once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dbbstation.errors import ModelError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.places import shipped_folder
from dbbstation.model.identified import IdentifiedModel
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.station.assembly import Job, assemble
from dbbstation.station.events import RunId
from dbbstation.trace.recording import Recording
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.station.bench import MACHINE_FILE

PLAN = shipped_folder("protocols") / "plans" / "table2-elevated.yaml"
RATE_HZ = 25.0
SEED = 5


class Silent:
    """An instrument that brings nothing."""

    def drain(self) -> list[object]:
        return []


@pytest.fixture(scope="module")
def truth() -> IdentifiedModel:
    """The machine's errors as a calibration would know them that has no doubt."""
    machine = read_machine(MACHINE_FILE)
    errors = random_kinematics(machine, SEED)
    rows = tuple((f.source.name, "", p.name) for f in errors for p in f.source.parameters(machine))
    return IdentifiedModel(MachineModel(machine, errors), rows, np.zeros((len(rows), len(rows))))


def wrong_of(folder: Path, run: str, made_of: str, model: IdentifiedModel | None, truth: IdentifiedModel) -> set[str]:
    machine, plan = read_machine(MACHINE_FILE), read_inline_plan(PLAN)
    virtual = VirtualMachine(truth.model, plan.to_domain(), seed=SEED)
    made = virtual.run(made_of, Direction.CCW)
    t_s = np.arange(0.0, made.path.duration_s + 1.0, 1.0 / RATE_HZ)
    length_mm = np.array([made.length_mm_at(float(t)) + virtual.noise_mm() for t in t_s])
    workplace = assemble(Job(machine, plan, folder, model=model), Silent())
    try:
        found = workplace.judge.judge(RunId(run, Direction.CCW, 1, 1), Recording(f"{run}-ccw-1", t_s, length_mm))
    finally:
        workplace.close()
    return {str(finding.name) for finding in found if finding.wrong}


def test_another_tests_circle_is_seen_at_once(tmp_path: Path, truth: IdentifiedModel) -> None:
    # The whole circle of f in place of i lies where i's may lie, as far as the nominal machine knows.
    assert wrong_of(tmp_path / "nominal", "i", "f", None, truth) == set()
    assert "bore" in wrong_of(tmp_path / "modelled", "i", "f", truth, truth)


def test_its_own_circle_is_where_the_model_expects_it(tmp_path: Path, truth: IdentifiedModel) -> None:
    assert wrong_of(tmp_path / "session", "i", "i", truth, truth) == set()


def test_a_model_of_another_machine_is_refused(tmp_path: Path, truth: IdentifiedModel) -> None:
    machine = read_machine(MACHINE_FILE)
    joints_mm = machine.hexapod.base_joints_mm.copy()
    joints_mm[0, 0] += 1.0
    other = replace(machine, hexapod=replace(machine.hexapod, base_joints_mm=joints_mm))
    job = Job(other, read_inline_plan(PLAN), tmp_path / "session", model=truth)
    with pytest.raises(ModelError, match="another nominal machine"):
        job.check("plan.yaml")
    assert not (tmp_path / "session").exists()
