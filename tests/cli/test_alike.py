"""Options are alike in every command; a command that lacks one has a reason, and a reason that is not needed any more goes."""

from __future__ import annotations

import json

import click
import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.errors import InputError
from dbbstation.files.places import shipped_folder
from dbbstation.tasks.load import load_sessions
from tests.cli.test_help import LINES, found

PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
SMALL = shipped_folder("fixtures") / "sessions" / "small"

NO_FORCE = {
    "import": "makes a session; one that exists is never replaced, nor is a mapping",
    "demo": "makes a new folder with everything of one demonstration; recordings are never replaced",
    "measure": "continues the session in its folder; nothing recorded is replaced",
    "simulate": "makes a session; one that exists is never replaced",
}

NO_TESTS = {
    "instrument emulate": "is told at its control address which test to run",
    "import": "takes the files that are given",
    "measure": "the operator skips tests with a key, and the session says which are missing",
    "session list": "lists all",
    "session log": "lists all",
    "session rebuild": "writes the whole session file",
    "session accept": "takes one run by its name",
    "session reject": "takes one run by its name",
    "session seal": "hashes all recordings",
    "session amend": "changes plan or machine of the whole session",
    "session take-in": "takes in all that lie in the folder",
    "settings": "looks beside the session and does not read it",
    "study coverage": "its --plan chooses between its own two plans",
    "study blind": "judges whole sessions against their answers",
}

WRITES = {"out", "figure", "log"}
TAKES_TESTS = {"sessions", "folder", "folders", "a", "plan", "plan_file", "session"}

LACKING = {
    "--json": ({}, bool, {"as_json"}),
    "--force": (NO_FORCE, lambda names: bool(names & WRITES), {"force"}),
    "--tests and --exclude": (NO_TESTS, lambda names: bool(names & TAKES_TESTS), {"tests", "exclude"}),
}


@pytest.mark.parametrize("what", LACKING)
def test_every_command_has_it_or_a_reason(what):
    reasons, wanted, needed = LACKING[what]
    lacking = set()
    for line in LINES:
        command, _ = found(line.split())
        names = {parameter.name for parameter in command.params}
        if wanted(names) and not needed <= names:
            lacking.add(line)
    assert lacking == set(reasons)


@pytest.mark.parametrize("option", ["tests", "exclude", "force", "as_json", "source_files", "sessions"])
def test_what_has_one_name_is_one_option(option):
    forms = set()
    for line in LINES:
        for parameter in found(line.split())[0].params:
            if parameter.name == option:
                many = parameter.multiple if isinstance(parameter, click.Option) else parameter.nargs
                forms.add((tuple(parameter.opts), type(parameter.type).__name__, many))
    assert len(forms) == 1


def named_in(data):
    return {run["test"] for run in data["runs"]}


def test_test_and_exclude_choose_tests_of_a_session(run):
    words = ("evaluate", SMALL, "--model", MODEL, "--json")
    assert named_in(run(*words).data) == {"a", "g", "l"}
    assert named_in(run(*words, "--tests", "a,l").data) == {"a", "l"}
    assert named_in(run(*words, "--tests", "a", "--tests", "l").data) == {"a", "l"}
    assert named_in(run(*words, "--exclude", "g").data) == {"a", "l"}
    assert named_in(run(*words, "--tests", "a,g", "--exclude", "g").data) == {"a"}


def test_a_test_that_no_session_has_is_refused():
    for names in ({"exclude": ["z"]}, {"only": ["z"]}):
        with pytest.raises(InputError, match="no session has a test z"):
            load_sessions([SMALL], **names)
    with pytest.raises(InputError, match="no accepted run is left"):
        load_sessions([SMALL], ["a"], only=["a"])


def test_test_and_exclude_choose_tests_of_a_plan(run, tmp_path):
    words = ("simulate", "--model", MODEL, PLAN, "--json")
    made = run(*words, "--tests", "c,a,b", "--exclude", "b", "--out", tmp_path / "s")
    assert made.code == DONE, made.err
    assert made.data["tests"] == ["c", "a"]
    written = {path.name.partition("-")[0] for path in (tmp_path / "s" / "runs").iterdir()}
    assert written == {"a", "c"}
    refused = run(*words, "--exclude", "zz", "--out", tmp_path / "t")
    assert refused.code == FAILED
    assert "the plan has no test zz; it has a, b, c" in refused.err
    none = run(
        "program", "--plan", PLAN, "--machine", MACHINE, "--tests", "a", "--exclude", "a", "--out", tmp_path / "nc"
    )
    assert none.code == FAILED
    assert "no test is left; exclude fewer" in none.err


def low(tmp_path, text="z_mm: [-1151, -1100]"):
    """A machine that cannot rise as far as most of the plan's circles."""
    machine = MACHINE.read_text(encoding="utf-8")
    assert "z_mm: [-1208, -808]" in machine
    path = tmp_path / "low.yaml"
    path.write_text(machine.replace("z_mm: [-1208, -808]", text), encoding="utf-8")
    return path


def test_a_plan_and_a_machine_are_dry_run(run):
    outcome = run("check", PLAN, MACHINE, "--json")
    assert outcome.code == DONE, outcome.err
    assert outcome.data["dry_runs"] == [{"plan": str(PLAN), "machine": str(MACHINE), "programs": 30, "ok": True}]
    assert "dry run: 30 programs within travel and feeds" in run("check", PLAN, MACHINE).out


def test_a_dry_run_lists_every_fault_where_program_stops_at_the_first(run, tmp_path):
    """Circles whose highest point, 20 mm of clearance included, is above -1100 mm: what the plan says, without the code."""
    machine = low(tmp_path)
    outcome = run("check", PLAN, machine, "--json")
    assert outcome.code == FAILED
    told = [p["what"] for p in json.loads(outcome.out)["problems"]]
    refused = set()
    for test in "abcdefghijklmno":
        for way in ("ccw", "cw"):
            one = run(
                "program", "--plan", PLAN, "--machine", machine, "--tests", test, "--out", tmp_path / f"{test}{way}"
            )
            if one.code == FAILED:
                refused.add(test)
    assert {what.partition("test ")[2].split()[0] for what in told} == refused
    assert len(told) == 2 * len(refused) > 2
    assert all(f"on {machine}: test " in what for what in told)
    first = run("program", "--plan", PLAN, "--machine", machine, "--out", tmp_path / "all").err.splitlines()
    assert len(first) == 1


def test_a_dry_run_takes_the_options_of_program(run, tmp_path):
    """Test a lies at -1150 mm: with 60 mm of clearance it leaves a travel that ends at -1100, with the bar on it stays."""
    machine = low(tmp_path)
    words = ("check", PLAN, machine, "--tests", "a")
    assert run(*words).code == DONE
    assert run(*words, "--clearance-mm", "60").code == FAILED
    assert run(*words, "--clearance-mm", "60", "--bar-stays-on").code == DONE


def test_choosing_tests_without_a_dry_run_is_refused(run):
    assert run("check", PLAN, "--tests", "a").code == USAGE


def test_of_several_machines_none_is_dry_run(run, tmp_path):
    outcome = run("check", PLAN, MACHINE, low(tmp_path), "--json")
    assert outcome.code == DONE
    assert outcome.data["dry_runs"] == []
