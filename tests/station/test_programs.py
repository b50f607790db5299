from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import pytest

from dbbstation.errors import InputError, TravelError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_plan
from dbbstation.files.recordings.session import read_session
from dbbstation.model.machine_model import MachineModel
from dbbstation.nc.circle_programs import circle_programs
from dbbstation.nc.export import Inverse
from dbbstation.nc.registry import dialect_named
from dbbstation.plan.plan import Direction
from dbbstation.station.programs import load_programs, read_toolpath
from dbbstation.tasks.load import load_sessions
from dbbstation.virtual.machine import path_of
from dbbstation.virtual.truth import random_kinematics
from tests.cli.conftest import call
from tests.station.bench import MACHINE_FILE, bench

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("copies")

MODEL_SHA256 = hashlib.sha256(b"a model").hexdigest()


@pytest.fixture
def one_way(plan_file: Path) -> Path:
    text = plan_file.read_text(encoding="utf-8")
    plan_file.write_text(text.replace("[ccw, cw]", "[ccw]").replace("repeat_at_end: [a]\n", ""), encoding="utf-8")
    return plan_file


@pytest.fixture
def folder(one_way: Path, tmp_path: Path) -> Path:
    """Programs compensated with half of what is wrong with the machine, so that the circles keep some shape."""
    machine, plan = read_machine(MACHINE_FILE), read_plan(one_way)
    half = tuple(
        type(fitted)(fitted.source, 0.5 * fitted.values, fitted.shared) for fitted in random_kinematics(machine, 3)
    )
    origin = {"model file": f"model.yaml, sha256 {MODEL_SHA256}"}
    inverse = Inverse(MachineModel(machine, half), origin)
    programs = circle_programs(plan, machine, dialect_named("linuxcnc"), inverse=inverse)
    made = tmp_path / "programs"
    made.mkdir()
    for program in programs:
        (made / program.file).write_text(program.text, encoding="utf-8")
    return made


def test_programs_are_found_and_their_model_with_them(one_way: Path, folder: Path) -> None:
    found = load_programs(folder, read_plan(one_way), read_machine(MACHINE_FILE))
    assert set(found) == {("a", Direction.CCW), ("b", Direction.CCW)}
    program = found["a", Direction.CCW]
    assert (program.name, program.model_sha256) == ("a-ccw.ngc", MODEL_SHA256)
    assert program.content == (folder / "a-ccw.ngc").read_bytes()


def test_every_program_that_is_missing_or_another_one_is_named(one_way: Path, folder: Path) -> None:
    plan, machine = read_plan(one_way), read_machine(MACHINE_FILE)
    (folder / "a-ccw.ngc").write_bytes((folder / "b-ccw.ngc").read_bytes())
    (folder / "b-ccw.ngc").unlink()
    with pytest.raises(InputError) as caught:
        load_programs(folder, plan, machine)
    said = str(caught.value)
    assert "off the plan's circle" in said
    assert "there is no program b-ccw" in said


def test_a_program_outside_the_travel_is_refused(one_way: Path, folder: Path) -> None:
    path = folder / "b-ccw.ngc"
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("M2", "G0 Z-100\nM2"), encoding="utf-8")
    with pytest.raises(TravelError, match="Z"):
        load_programs(folder, read_plan(one_way), read_machine(MACHINE_FILE))


@pytest.mark.slow
def test_runs_by_program_are_smaller_in_error_and_carry_the_program(
    one_way: Path, folder: Path, tmp_path: Path
) -> None:
    def program(name: str) -> object:
        return path_of(read_toolpath(folder / name, (folder / name).read_bytes()))

    plain, halved = tmp_path / "plain", tmp_path / "halved"
    with bench(one_way, programs=program) as place:  # type: ignore[arg-type]
        first = place.measure(plain)
        second = place.measure(halved, "--programs", str(folder))
        mixed = call(*place.command(plain, "--programs", str(folder)))
    assert (first.returncode, second.returncode) == (0, 0), first.stderr + second.stderr
    assert mixed.code == 1
    assert "commanded by plain circles, now NC programs are asked for" in mixed.err
    assert "Start the NC program a-ccw.ngc" in second.stderr
    session = read_session(halved)
    kept = session.runs[0].program
    assert kept is not None
    assert (kept.path.name, kept.model_sha256) == ("a-ccw.ngc", MODEL_SHA256)
    assert kept.path.read_bytes() == (folder / "a-ccw.ngc").read_bytes()
    (before, *_), (after, *_) = load_sessions([plain]).observations, load_sessions([halved]).observations
    assert after.commanded is not None
    worst_before, worst_after = (abs(each.raw.length_mm - 150.0).max() for each in (before, after))
    assert worst_after == pytest.approx(worst_before / 2.0, rel=0.1)
