"""The seal of a session: what was changed since is told, by file and key or by run; changing on purpose notes why."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from dbbstation.cli import main
from dbbstation.errors import InputError
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import SessionDetails
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.amending import amend
from dbbstation.files.recordings.new_session import FinishedRun, write_session
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.model.machine_model import MachineModel
from dbbstation.plan.plan import Direction
from dbbstation.virtual.machine import VirtualMachine
from dbbstation.virtual.truth import random_kinematics
from tests.files.recordings.test_session_writer import BEGUN, COLUMNS, fill

MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
PLAN = shipped_folder("protocols") / "plans" / "ten-minute-check.yaml"


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sealed") / "session"
    machine, plan = read_machine(MACHINE), read_inline_plan(PLAN)
    virtual = VirtualMachine(MachineModel(machine, random_kinematics(machine, 7)), plan.to_domain(), seed=7)
    runs = []
    for test in plan.tests[:3]:
        for direction in Direction:
            run = virtual.run(test.name, direction, begin_s=180.0 * len(runs))
            times = [0.2 * index for index in range(int(run.path.duration_s / 0.2))]
            lengths = [run.length_mm_at(t) for t in times]
            columns = {"t_s": _array(times), "length_mm": _array(lengths)}
            runs.append(FinishedRun(test.name, direction, columns, 1, run.mounting, BEGUN))
    write_session(folder, machine, plan, runs, SessionDetails())
    return folder


def _array(values):
    return np.array(values).round(7)


@pytest.fixture
def folder(made, tmp_path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "session"))


def change(path: Path, old: str, new: str, count: int = 1) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, count), encoding="utf-8")


def run_lines(folder: Path) -> tuple[list[str], list[str]]:
    lines = (folder / "session.yaml").read_text(encoding="utf-8").splitlines(keepends=True)
    at = lines.index("runs:\n") + 1
    return lines[:at], lines[at:]


def with_runs(folder: Path, runs: list[str]) -> None:
    head, _ = run_lines(folder)
    (folder / "session.yaml").write_text("".join([*head, *runs]), encoding="utf-8")


def told(folder: Path) -> str:
    with pytest.raises(InputError) as refused:
        read_session(folder)
    return str(refused.value)


def test_the_hashes_are_those_of_the_files(folder):
    seal = read_session(folder).seal
    assert seal is not None
    assert seal.files == {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in ("machine.yaml", "plan.yaml")
    }
    assert seal.runs == 6


def test_the_chain_can_be_followed_with_nothing_but_the_documented_rule(folder):
    """By hand, from docs/formats.md: the link before, then what the entry says, one value a line."""
    session = read_session(folder)
    before = ""
    for run in session.runs:
        said = [
            before,
            run.test,
            str(run.direction),
            str(run.repeat),
            str(run.mounting),
            "2026-11-20T08:00:00.250000+00:00",
        ]
        said += [run.sha256, "", "", "", "", ""]
        before = hashlib.sha256("".join(f"{value}\n" for value in said).encode()).hexdigest()
        assert run.chain_sha256 == before
    assert session.seal.chain_sha256 == before


def test_a_joint_that_was_shifted_is_named_with_both_values(folder):
    machine = folder / "machine.yaml"
    joint = float(read_machine(machine).hexapod.base_joints_mm[0][0])
    before = hashlib.sha256(machine.read_bytes()).hexdigest()
    change(machine, f"[{joint!r}", f"[{joint + 0.2:.8f}")
    text = told(folder)
    now = hashlib.sha256(machine.read_bytes()).hexdigest()
    assert f"{machine}: the file is not the one that was sealed: its SHA-256 was {before}, is {now}" in text
    assert f"base_joints_mm[0][0] is {joint + 0.2:.8f}, was {joint!r}" in text
    assert f"restore it from sealed/machine-{before[:16]}.yaml, or say why it was changed" in text
    assert f"dbbstation session amend {folder} --reason" in text


def test_a_test_that_was_taken_out_of_the_plan_is_named(folder):
    plan = folder / "plan.yaml"
    lines = plan.read_text(encoding="utf-8").splitlines(keepends=True)
    unmeasured = [line for line in lines if re.match(r"  - \{name: ", line)][-1]
    plan.write_text("".join(line for line in lines if line != unmeasured), encoding="utf-8")
    name = re.search(r"name: ([\w-]+)", unmeasured).group(1)
    assert f"tests.{name} is gone" in told(folder)


def test_a_comment_is_a_change_and_said_to_be_no_value(folder):
    change(folder / "plan.yaml", "name:", "# looked at\nname:")
    assert "no value differs, only how it is written" in told(folder)


def test_a_file_that_is_gone_or_another_one_is_told(folder):
    shutil.copyfile(folder / "machine.yaml", folder / "other.yaml")
    change(folder / "session.yaml", "machine: machine.yaml", "machine: other.yaml")
    assert "other.yaml was not sealed" in told(folder)


@pytest.mark.parametrize("index", range(6))
def test_a_run_that_was_taken_out_is_told(folder, index):
    _, runs = run_lines(folder)
    with_runs(folder, runs[:index] + runs[index + 1 :])
    text = told(folder)
    assert "the list of runs lacks 1 of 6 sealed runs: it was taken out" in text
    if index < 5:
        following = read_label(runs[index + 1])
        assert f"run {following} was sealed after a run that is not in the list any more" in text


def test_two_runs_that_were_taken_out_are_told(folder):
    _, runs = run_lines(folder)
    with_runs(folder, runs[2:])
    assert "the list of runs lacks 2 of 6 sealed runs: they were taken out" in told(folder)


def read_label(line: str) -> str:
    return " ".join(re.search(r"test: (\w+), direction: (\w+), repeat: (\d+)", line).groups())


def test_two_runs_that_were_exchanged_are_told_with_where_they_were(folder):
    _, runs = run_lines(folder)
    with_runs(folder, [*runs[:2], runs[3], runs[2], *runs[4:]])
    text = told(folder)
    two, three, four = (read_label(runs[k]) for k in (1, 2, 3))
    assert f"run {four} was sealed after run {three} and stands after run {two}" in text
    assert f"run {three} was sealed after run {two} and stands after run {four}" in text


def test_an_entry_that_was_changed_is_told(folder):
    _, runs = run_lines(folder)
    assert "mounting: 1" in runs[0]
    with_runs(folder, [runs[0].replace("mounting: 1", "mounting: 9"), *runs[1:]])
    assert f"the entry of run {read_label(runs[0])} is not the one that was sealed" in told(folder)


def test_runs_are_judged_without_breaking_the_chain(folder):
    with SessionWriter.open(folder) as writer:
        links = [run.chain_sha256 for run in writer.runs]
        writer.judge(writer.runs[1], accepted=False, reason="bumped")
        assert [run.chain_sha256 for run in read_session(folder).runs] == links


def test_a_run_that_is_added_comes_behind_a_dead_one(folder):
    with SessionWriter.open(folder) as writer:
        first = writer.start_run("low", Direction.CCW, COLUMNS, started=BEGUN, mounting=1)
        first.append((0.0, 150.0))
        first.close()  # the station died
    with SessionWriter.open(folder) as writer:
        with writer.start_run("low", Direction.CCW, COLUMNS, started=BEGUN, mounting=1) as journal:
            fill(journal)
            writer.finish_run(journal)
        seal = read_session(folder).seal
        assert seal.runs == 7
        assert seal.chain_sha256 == read_session(folder).runs[-1].chain_sha256


def test_a_session_of_an_older_program_is_sealed_before_more_is_recorded_into_it(tmp_path):
    folder = Path(shutil.copytree(shipped_folder("fixtures") / "sessions" / "small", tmp_path / "small"))
    with SessionWriter.open(folder) as writer:
        assert writer.session.seal is None
        with writer.start_run("a", Direction.CCW, COLUMNS, started=BEGUN, mounting=1) as journal:
            fill(journal)
            writer.finish_run(journal)
    session = read_session(folder)
    assert session.seal.runs == 8
    assert (folder / "session.yaml").read_text(encoding="utf-8").startswith("format: dbb-session/1\n")


def test_amending_keeps_the_former_file_and_notes_why(folder):
    machine = folder / "machine.yaml"
    before = machine.read_bytes()
    change(machine, "name: ", "name: measured again, ")
    noted = amend(folder, "joint 3 measured again", made=BEGUN)
    session = read_session(folder)
    assert session.amendments == noted
    (change_,) = noted
    assert (change_.what, change_.reason, change_.made) == ("machine.yaml", "joint 3 measured again", BEGUN)
    assert change_.former_sha256 == hashlib.sha256(before).hexdigest()
    assert change_.sha256 == hashlib.sha256(machine.read_bytes()).hexdigest()
    assert (folder / change_.former).read_bytes() == before
    assert session.machine.name.startswith("measured again, ")


def test_another_plan_takes_the_place_of_the_sealed_one(folder, tmp_path):
    before = (folder / "plan.yaml").read_bytes()
    new = tmp_path / "new.yaml"
    new.write_text(before.decode().replace("name: ", "name: corrected ", 1), encoding="utf-8")
    (change_,) = amend(folder, "sheet corrected", made=BEGUN, plan=new)
    assert read_session(folder).plan.name.startswith("corrected ")
    assert (folder / change_.former).read_bytes() == before
    # The change after it keeps both.
    change(folder / "plan.yaml", "corrected ", "twice corrected ")
    amend(folder, "again", made=BEGUN)
    assert len(read_session(folder).amendments) == 2
    assert len(list((folder / "sealed").glob("plan-*.yaml"))) == 3


def test_a_plan_without_the_tests_of_the_runs_is_refused_and_nothing_is_written(folder, tmp_path):
    new = tmp_path / "new.yaml"
    new.write_text(PLAN.read_text(encoding="utf-8").replace("name: low", "name: lower"), encoding="utf-8")
    files = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="the plan has no test `low`"):
        amend(folder, "why", made=BEGUN, plan=new)
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == files


def test_a_list_of_runs_can_be_taken_as_it_stands_with_a_reason(folder):
    _, runs = run_lines(folder)
    former = (folder / "session.yaml").read_bytes()
    with_runs(folder, runs[:-1])
    assert amend(folder, "the last run was of another machine", made=BEGUN)[0].what == "runs"
    assert read_session(folder).seal.runs == 5
    assert former != (folder / "session.yaml").read_bytes()


def test_nothing_to_amend(folder):
    with pytest.raises(InputError, match="nothing differs from what was sealed"):
        amend(folder, "why", made=BEGUN)


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "session list", "check"])
def test_commands_refuse_a_session_whose_plan_was_changed(folder, capsys, command):
    change(folder / "plan.yaml", "feed_mm_min: ", "feed_mm_min: 1")
    with pytest.raises(SystemExit) as left:
        main([*command.split(), str(folder), "--json"])
    assert left.value.code == 1
    assert "dbbstation session amend" in capsys.readouterr().err


def test_check_says_what_was_amended_and_what_carries_no_seal(folder, capsys):
    change(folder / "machine.yaml", "name: ", "name: measured again, ")
    with pytest.raises(SystemExit) as left:
        main(["session", "amend", str(folder), "--reason", "joint 3 measured again", "--json"])
    assert left.value.code == 0
    assert json.loads(capsys.readouterr().out)["changed"][0]["what"] == "machine.yaml"
    with pytest.raises(SystemExit) as left:
        main(["check", str(folder), str(shipped_folder("fixtures") / "sessions" / "small")])
    printed = capsys.readouterr()
    assert left.value.code == 0
    assert "machine.yaml was changed on purpose" in printed.err
    assert "joint 3 measured again" in printed.err
    assert re.search(
        r"session: 6 runs \(6 accepted\); sealed, 2 events, anchor [0-9a-f]{16}$", printed.out, re.MULTILINE
    )
    assert "it carries no seal" in printed.out
