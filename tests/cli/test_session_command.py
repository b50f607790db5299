"""`dbbstation session`: runs are judged afterwards, and recordings made elsewhere get their hashes."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from pathlib import Path

import pytest

from dbbstation.cli import main
from dbbstation.errors import InputError
from dbbstation.files.formats.session import RunState, SessionFile
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.seal import chained
from dbbstation.files.recordings.sealing import seal_session, sealing
from dbbstation.files.recordings.session import read_session
from dbbstation.files.yaml.schema import validate
from dbbstation.files.yaml.text import parse_yaml
from tests.plant.session import record


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("session") / "elsewhere"
    record(folder, seed=3, rate_hz=4.0)
    return folder


@pytest.fixture
def folder(recorded, tmp_path):
    return Path(shutil.copytree(recorded, tmp_path / "elsewhere"))


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        main(["session", *map(str, arguments)])
    out, err = capsys.readouterr()
    return left.value.code, out, err


def test_a_rejected_run_is_kept_with_its_reason_and_can_be_taken_back(capsys, folder):
    before = read_session(folder)
    recording = before.runs[1].path.read_bytes()
    name = f"{before.runs[1].test}-{before.runs[1].direction}-1"
    assert run(capsys, "reject", folder, name, "--reason", " chip under the holder ")[0] == 0
    after = read_session(folder)
    assert (after.runs[1].state, after.runs[1].reason) == (RunState.REJECTED, "chip under the holder")
    assert after.runs[1].path.read_bytes() == recording
    assert [r for k, r in enumerate(after.runs) if k != 1] == [r for k, r in enumerate(before.runs) if k != 1]
    listed = run(capsys, "list", folder)[1]
    assert re.search(rf"^{name} .*rejected +chip under the holder$", listed, re.MULTILINE)
    assert listed.rstrip().endswith(f"no accepted run: {before.runs[1].test} {before.runs[1].direction}")
    assert run(capsys, "accept", folder, name)[0] == 0
    assert read_session(folder).runs == before.runs


def test_a_circle_with_one_accepted_run_is_not_talked_of(capsys):
    small = shipped_folder("fixtures") / "sessions" / "small"
    assert "accepted runs" not in run(capsys, "list", small)[1]


def test_two_accepted_runs_of_a_circle_are_said(capsys, tmp_path):
    folder = Path(shutil.copytree(shipped_folder("fixtures") / "sessions" / "small", tmp_path / "small"))
    assert run(capsys, "accept", folder, "a-cw-1")[0] == 0
    assert "a cw has 2 accepted runs: all of them count" in run(capsys, "list", folder)[1]


def test_the_list_as_json_has_every_run(capsys, folder):
    told = json.loads(run(capsys, "list", folder, "--json")[1])
    session = read_session(folder)
    assert [entry["run"] for entry in told["runs"]] == [f"{r.test}-{r.direction}-{r.repeat}" for r in session.runs]
    assert {entry["state"] for entry in told["runs"]} == {"accepted"}
    assert told["missing"] == []


def test_no_run_of_that_name(capsys, folder):
    before = (folder / "session.yaml").read_bytes()
    code, _, err = run(capsys, "accept", folder, "a-cw-11")
    assert code == 1
    assert "did you mean a-cw-1?" in err
    code, _, err = run(capsys, "reject", folder, "a-cw-1", "--reason", "  ")
    assert code == 2
    assert "give the reason" in err
    assert (folder / "session.yaml").read_bytes() == before


def test_sealing_puts_back_every_hash_and_nothing_else(capsys, folder):
    file = folder / "session.yaml"
    sealed = file.read_text(encoding="utf-8")
    bare = re.sub(r", sha256: [0-9a-f]{64}", "", sealed)
    file.write_text(bare, encoding="utf-8")
    with pytest.raises(InputError, match="no sha256"):
        read_session(folder)
    code, out, _ = run(capsys, "seal", folder, "--dry-run")
    assert code == 0
    assert out.count("csv: would be sealed") == bare.count("file: runs/")
    assert file.read_text(encoding="utf-8") == bare
    assert run(capsys, "seal", folder)[0] == 0
    assert [r.sha256 for r in read_session(folder).runs] == [
        hashlib.sha256(r.path.read_bytes()).hexdigest() for r in read_session(folder).runs
    ]
    whole = file.read_text(encoding="utf-8")
    assert run(capsys, "seal", folder)[1] == "every run and file is sealed already\n"
    without = re.sub(r", (chain_)?sha256: [0-9a-f]{64}", "", re.sub(r"seal:\n(  .*\n)+(?=runs:)", "", whole))
    assert without.replace("dbb-session/1", "dbb-session/1") == bare


def test_a_file_written_by_hand_keeps_its_comments(folder):
    names = sorted(path.name for path in (folder / "runs").iterdir())[:2]
    text = f"""# made with the old program
format: dbb-session/1
machine: machine.yaml
plan: plan.yaml
runs:
  - test: a
    direction: ccw
    repeat: 1
    file: runs/{names[0]}  # the first one
    state: accepted
  - {{test: a, direction: cw, repeat: 1, file: runs/{names[1]}, state: accepted}}
  - {{test: b, direction: cw, repeat: 1, file: runs/none.csv.part, state: recording}}
"""
    (folder / "session.yaml").write_text(text, encoding="utf-8")
    found = sealing(folder)
    digests = [hashlib.sha256((folder / "runs" / name).read_bytes()).hexdigest() for name in names]
    assert found.files == (f"runs/{names[0]}", f"runs/{names[1]}")
    first, second, never = [run.chain_sha256 for run in chained(parsed(found.text).runs)]
    assert f"  # the first one\n    sha256: {digests[0]}\n    chain_sha256: {first}\n    state: accepted" in found.text
    assert f"file: runs/{names[1]}, sha256: {digests[1]}, chain_sha256: {second}, state: accepted}}" in found.text
    assert never == ""
    assert found.text.count("sha256") == 5
    assert found.text.startswith("# made with the old program\nformat: dbb-session/1\n")
    seal_session(folder)
    assert sealing(folder).anything is False


def parsed(text: str) -> SessionFile:
    return validate(parse_yaml(text, "session.yaml", []), SessionFile)


def test_a_recording_that_is_missing_is_named_with_its_line(capsys, folder):
    file = folder / "session.yaml"
    file.write_text(re.sub(r", sha256: [0-9a-f]{64}", "", file.read_text(encoding="utf-8")), encoding="utf-8")
    gone = next((folder / "runs").iterdir())
    gone.unlink()
    before = file.read_bytes()
    code, _, err = run(capsys, "seal", folder)
    assert code == 1
    assert re.search(rf"session\.yaml:\d+:\d+: the run file runs/{re.escape(gone.name)} is missing", err)
    assert file.read_bytes() == before


def test_a_folder_of_sessions_is_answered_with_their_names(folder):
    with pytest.raises(InputError, match=r"no session\.yaml in it; did you mean .*elsewhere\?"):
        read_session(folder.parent)
    with pytest.raises(InputError, match=r"did you mean .*elsewhere\?"):
        read_session(folder / "runs")
    empty = folder.parent / "more" / "empty"
    empty.mkdir(parents=True)
    with pytest.raises(InputError, match="name a session folder"):
        read_session(empty)


def test_no_session_there(capsys, tmp_path):
    code, _, err = run(capsys, "seal", tmp_path)
    assert code == 1
    assert "session.yaml" in err
    assert "Traceback" not in err


@pytest.fixture
def half_lost(folder):
    entry = read_session(folder).runs[1]
    lines = entry.path.read_text().splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if line[:1].isdigit())
    kept = [line for k, line in enumerate(lines[first:]) if k // 10 % 2 == 0]
    entry.path.write_text("".join(lines[:first] + kept))
    file = folder / "session.yaml"
    file.write_text(re.sub(r", sha256: [0-9a-f]{64}", "", file.read_text(encoding="utf-8")), encoding="utf-8")
    seal_session(folder)
    return f"{entry.test}-{entry.direction}-{entry.repeat}"


def test_a_run_that_cannot_be_used_is_accepted_with_a_reason_only(capsys, folder, half_lost):
    before = (folder / "session.yaml").read_bytes()
    code, out, err = run(capsys, "accept", folder, half_lost)
    assert (code, out) == (2, "")
    assert "give the reason with --reason" in err
    assert "lost" in err
    assert (folder / "session.yaml").read_bytes() == before
    code, out, err = run(capsys, "accept", folder, half_lost, "--reason", " gauge was slow ")
    assert (code, out, err) == (0, f"{half_lost}: accepted (gauge was slow)\n", "")
    assert read_session(folder).runs[1].reason == "gauge was slow"
    events = json.loads(run(capsys, "log", folder, "--json")[1])["events"]
    assert (events[-1]["what"], events[-1]["about"]) == ("accepted", f"{half_lost}: gauge was slow")


def test_on_a_terminal_the_reason_is_asked_for(capsys, folder, half_lost, monkeypatch):
    answers = iter(["  ", "feed-in only was lost"])
    monkeypatch.setattr("dbbstation.cli.asking.on_terminal", lambda: True)
    monkeypatch.setattr("click.prompt", lambda *_args, **_kwargs: next(answers))
    code, _, err = run(capsys, "accept", folder, half_lost)
    assert code == 0
    assert "lost" in err
    assert read_session(folder).runs[1].reason == "feed-in only was lost"


def test_repeats_are_listed_as_they_are_counted(capsys, folder):
    """A list of files sorted by name has a-ccw-10 before a-ccw-2."""
    entry, *others = read_session(folder).runs
    named = f"{entry.test}, direction: {entry.direction}"
    numbers = (1, 10, 2)
    lines = []
    for repeat in numbers:
        path = entry.path.with_name(f"{entry.test}-{entry.direction}-{repeat}.csv")
        path.write_text(re.sub(r"(repeat\W+)1\b", rf"\g<1>{repeat}", entry.path.read_text(), count=1))
        lines.append(f"  - {{test: {named}, repeat: {repeat}, file: runs/{path.name}, state: accepted}}")
    text = "format: dbb-session/1\nmachine: machine.yaml\nplan: plan.yaml\nruns:\n" + "\n".join(lines) + "\n"
    (folder / "session.yaml").write_text(text, encoding="utf-8")
    for other in others:
        other.path.unlink()
    seal_session(folder)
    told = json.loads(run(capsys, "list", folder, "--json")[1])
    assert [one["repeat"] for one in told["runs"]] == [1, 2, 10]
    assert [one.repeat for one in read_session(folder).in_state(RunState.ACCEPTED)] == [1, 2, 10]
    assert main_circles(capsys, folder) == ["1", "2", "10"]


def main_circles(capsys, folder):
    with pytest.raises(SystemExit):
        main(["circles", str(folder)])
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    return [row[2] for row in rows if len(row) > 3 and row[1] in {"ccw", "cw"}]
