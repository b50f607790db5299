"""The event log: what decides cannot be edited unnoticed, and a session file that was spoilt comes back from it."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from datetime import timedelta
from pathlib import Path

import pytest

from dbbstation.cli import DONE, FAILED
from dbbstation.errors import InputError, OutputError
from dbbstation.files.formats.session import Note, RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.amending import amend
from dbbstation.files.recordings.event_log import EVENTS_FILE, read_event_log
from dbbstation.files.recordings.seal import copy_faults
from dbbstation.files.recordings.sealing import seal_session
from dbbstation.files.recordings.session import read_session
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction
from tests.cli.conftest import call
from tests.files.recordings.test_session_writer import BEGUN, COLUMNS, fill

SESSIONS = shipped_folder("fixtures") / "sessions"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Seven sealed runs, one rejected by the operator, one that died; a bar, a note, an amendment."""
    return Path(shutil.copytree(SESSIONS / "logged", tmp_path / "session"))


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def told(folder: Path) -> str:
    with pytest.raises(InputError) as refused:
        read_session(folder)
    return str(refused.value)


def sound(folder: Path) -> bool:
    session = read_session(folder)
    return not list(copy_faults(folder, session.seal, session.amendments))


def test_check_names_what_was_edited_and_copies_that_were_spoilt(folder: Path) -> None:
    copy = min((folder / "sealed").iterdir())
    data = copy.read_bytes()
    copy.write_bytes(data[:-1])
    outcome = call("check", folder)
    assert (outcome.code, copy.name in outcome.err) == (FAILED, True)
    copy.write_bytes(data)
    edit(folder / "session.yaml", "lost: 1", "lost: 0")
    outcome = call("check", folder)
    assert (outcome.code, "counts.lost is 0, was 1, by the event log" in outcome.err) == (FAILED, True)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("state: rejected", "state: accepted", "runs.a-cw-1.state is accepted, was rejected"),
        ("reason: operator", "reason: chip", "runs.a-cw-1.reason is chip, was operator"),
        ("calibrated_length_mm: 150.0003", "calibrated_length_mm: 150.0023", "is 150.0023, was 150.0003"),
        ("calibrator_uncertainty_mm: 0.0005", "calibrator_uncertainty_mm: 0.0001", "is 0.0001, was 0.0005"),
        ("lost: 1", "lost: 0", "runs.a-cw-1.counts.lost is 0, was 1"),
        ("ambient_temp_c: 20.4", "ambient_temp_c: 22.4", "ambient_temp_c is 22.4, was 20.4"),
        ("operator: first shift", "operator: second shift", "operator is second shift, was first shift"),
        ("the gate was opened", "all was quiet", "text is all was quiet, was the gate was opened"),
        ("reason: the machine has a name of its own", "reason: none", "reason is none, was the machine has a name"),
        ("bar_waiver:", "job: x\nbar_waiver:", "job is new"),
    ],
)
def test_what_decides_cannot_be_edited_unnoticed(folder: Path, old: str, new: str, said: str) -> None:
    edit(folder / "session.yaml", old, new)
    text = told(folder)
    assert said in text
    assert f"dbbstation session rebuild {folder}" in text
    assert f"dbbstation session amend {folder} --reason" in text


def test_an_edit_is_taken_back_or_taken_with_a_reason(folder: Path) -> None:
    before = (folder / "session.yaml").read_bytes()
    edit(folder / "session.yaml", "state: rejected\n    reason: operator", "state: accepted")
    edited = (folder / "session.yaml").read_bytes()
    assert call("session", "rebuild", folder).code == DONE
    assert read_session(folder).runs[1].state is RunState.REJECTED
    kept = folder / "sealed" / f"session-{hashlib.sha256(edited).hexdigest()[:16]}.yaml"
    assert kept.read_bytes() == edited
    (folder / "session.yaml").write_bytes(edited)
    (change,) = amend(folder, "it was the other run", made=BEGUN)
    assert (change.what, change.reason) == ("session.yaml", "it was the other run")
    assert read_session(folder).runs[1].state is RunState.ACCEPTED
    assert "reason: operator" in (folder / change.former).read_text(encoding="utf-8")
    assert before != edited
    assert sound(folder)


def test_a_log_can_be_followed_with_nothing_but_the_documented_rule(folder: Path) -> None:
    """By hand, from docs/formats.md: SHA-256 over the link before and the JSON text, each with a line feed."""
    before, state, runs = "", {}, {}
    for line in (folder / EVENTS_FILE).read_text(encoding="utf-8").splitlines():
        link, text = line.split("  ", 1)
        assert hashlib.sha256(f"{before}\n{text}\n".encode()).hexdigest() == link
        said = json.loads(text)
        state |= said.get("set", {})
        for run in said.get("runs", ()):
            runs[run["test"], run["direction"], run["repeat"]] = run
        before = link
    session = read_session(folder)
    assert session.seal.log.sha256 == before
    assert [(r["state"], r.get("reason", "")) for r in runs.values()] == [
        (r.state.value, r.reason) for r in session.runs
    ]
    assert state["bar"]["calibrated_length_mm"] == session.bar.calibrated_length_mm


@pytest.mark.parametrize("line", [0, 6, 22, 24])
def test_a_line_of_the_log_that_was_changed_or_taken_out_is_told(folder: Path, line: int) -> None:
    path = folder / EVENTS_FILE
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text("".join([*lines[:line], *lines[line + 1 :]]), encoding="utf-8")
    assert f"events.log has {line} of 25 events: line {line + 1} is not" in told(folder)
    changed = lines[line].replace("2026-11-20", "2026-11-21", 1)
    path.write_text("".join([*lines[:line], changed, *lines[line + 1 :]]), encoding="utf-8")
    assert f"events.log has {line} of 25 events: line {line + 1} is not as it was written" in told(folder)
    (change,) = amend(folder, "the disk was spoilt", made=BEGUN)
    assert change.what == EVENTS_FILE
    assert (folder / change.former).read_text(encoding="utf-8").count("\n") == 25
    assert sound(folder)


def test_a_log_that_is_gone_or_another_one_is_told(folder: Path) -> None:
    text = (folder / EVENTS_FILE).read_bytes()
    (folder / EVENTS_FILE).unlink()
    assert "events.log, which the seal covers, is not there" in told(folder)
    (folder / EVENTS_FILE).write_bytes(text.replace(b"first shift", b"third shift"))
    assert "events.log has 0 of 25 events" in told(folder)


def test_a_seal_that_was_taken_out_is_told(folder: Path) -> None:
    text = (folder / "session.yaml").read_text(encoding="utf-8")
    bare = re.sub(r"seal:\n(  .*\n)+", "", text).replace("dbb-session/1", "dbb-session/1")
    (folder / "session.yaml").write_text(re.sub(r", chain_sha256: [0-9a-f]{64}", "", bare), encoding="utf-8")
    assert "the seal was taken out: events.log has 25 events of this session" in told(folder)
    with pytest.raises(InputError, match="the seal was taken out"):
        seal_session(folder)
    assert call("session", "rebuild", folder).code == DONE
    assert (folder / "session.yaml").read_text(encoding="utf-8").count("chain_sha256") == text.count("chain_sha256")


@pytest.mark.parametrize("how", ["spoilt", "gone", "another"])
def test_every_copy_in_sealed_is_checked(folder: Path, how: str) -> None:
    copies = sorted((folder / "sealed").iterdir())
    assert len(copies) == 3
    for copy in copies:
        data = copy.read_bytes()
        if how == "gone":
            copy.unlink()
        else:
            copy.write_bytes(data + b"\n" if how == "spoilt" else b"format: dbb-machine/1\n")
        session = read_session(folder)
        (fault,) = copy_faults(folder, session.seal, session.amendments)
        assert fault.file == str(copy)
        copy.write_bytes(data)
        assert sound(folder)


def test_a_copy_is_put_right_from_what_was_sealed(folder: Path) -> None:
    name = next(path for path in (folder / "sealed").iterdir() if path.name.startswith("plan-"))
    data = name.read_bytes()
    name.write_bytes(b"")
    session = read_session(folder)
    (fault,) = copy_faults(folder, session.seal, session.amendments)
    assert fault.remedy == f"`dbbstation session seal {folder}` puts it right"
    assert call("session", "seal", folder).code == DONE
    assert name.read_bytes() == data


def test_a_former_session_file_comes_forward_by_itself(folder: Path) -> None:
    former = (folder / "session.yaml").read_bytes()
    with SessionWriter.open(folder) as writer:
        writer.judge(writer.runs[0], accepted=False, reason="chip")
        writer.note(Note(BEGUN, "gate closed"))
    (folder / "session.yaml").write_bytes(former)
    session = read_session(folder)
    assert (session.runs[0].state, session.runs[0].reason) == (RunState.REJECTED, "chip")
    assert session.notes[-1].text == "gate closed"
    assert (folder / "session.yaml").read_bytes() == former  # whoever only reads writes nothing
    SessionWriter.open(folder).close()
    assert b"reason: chip" in (folder / "session.yaml").read_bytes()


@pytest.mark.parametrize("spoilt", [b"", b"\0" * 4000, b"runs: [", b"- a\n- b\n", b"word\n", None])
def test_a_session_file_that_was_spoilt_is_written_anew(folder: Path, spoilt: bytes | None) -> None:
    before = read_session(folder)
    file = folder / "session.yaml"
    file.unlink() if spoilt is None else file.write_bytes(spoilt)
    with pytest.raises(InputError, match="dbbstation session rebuild"):
        read_session(folder)
    with SessionWriter.open(folder) as writer:  # as the station does when it goes on
        assert writer.runs == before.runs
        writer.judge(writer.runs[0], accepted=False, reason="chip")
    after = read_session(folder)
    assert (after.bar, after.runs[1:]) == (before.bar, before.runs[1:])
    assert "could not be read and was written anew" in after.notes[-1].text
    if spoilt:
        kept = folder / "sealed" / f"session-{hashlib.sha256(spoilt).hexdigest()[:16]}.yaml"
        assert kept.read_bytes() == spoilt


@pytest.mark.parametrize("spoilt", [b"", b"\0" * 4000, b"runs: [", None])
def test_a_session_file_that_is_spoilt_while_a_run_comes_in_is_written_anew(folder: Path, spoilt: bytes | None) -> None:
    file = folder / "session.yaml"
    with SessionWriter.open(folder) as writer:
        journal = writer.start_run("a", Direction.CCW, COLUMNS, started=BEGUN)
        fill(journal)
        file.unlink() if spoilt is None else file.write_bytes(spoilt)
        writer.judge(writer.finish_run(journal), accepted=True)
    session = read_session(folder)
    assert (session.runs[-1].label, session.runs[-1].state) == ("a ccw 2", RunState.ACCEPTED)
    assert "could not be read" in session.notes[-1].text


def test_nothing_is_written_over_what_somebody_else_has_written(folder: Path) -> None:
    with SessionWriter.open(folder) as writer:
        edit(folder / "session.yaml", "operator: first shift", "operator: second shift")
        text = (folder / "session.yaml").read_bytes()
        log = (folder / EVENTS_FILE).read_bytes()
        with pytest.raises(
            OutputError, match="somebody has changed the session file since it was read: operator is second"
        ):
            writer.judge(writer.runs[0], accepted=False, reason="chip")
        assert writer.runs[0].state is RunState.ACCEPTED
        assert ((folder / "session.yaml").read_bytes(), (folder / EVENTS_FILE).read_bytes()) == (text, log)


def test_without_locks_a_log_that_has_gone_on_is_not_written_behind(folder: Path, monkeypatch) -> None:
    monkeypatch.setattr("dbbstation.files.recordings.lock.SessionLock._locked", lambda *_: False)
    with SessionWriter.open(folder) as one, SessionWriter.open(folder) as other:
        other.judge(other.runs[0], accepted=False, reason="chip")
        with pytest.raises(OutputError, match="somebody has changed the session file"):
            one.judge(one.runs[2], accepted=False, reason="cable")
    assert [run.reason for run in read_session(folder).runs[:3]] == ["chip", "operator", ""]
    assert len(read_event_log(folder, []).events) == 26


def test_a_seal_without_its_log_is_a_fault(folder: Path) -> None:
    (folder / EVENTS_FILE).unlink()
    edit(folder / "session.yaml", re.search(r"  log: .*\n", (folder / "session.yaml").read_text())[0], "")
    outcome = call("check", folder)
    assert outcome.code == FAILED
    assert "the seal names no event log" in outcome.err


def test_sealing_begins_a_log_and_leaves_the_text_as_it_is(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(SESSIONS / "small", tmp_path / "small"))
    edit(folder / "session.yaml", "runs:\n  - {test", "runs:\n  # the first of the day\n  - {test")
    assert seal_session(folder).anything
    text = (folder / "session.yaml").read_text(encoding="utf-8")
    assert "  # the first of the day\n" in text
    assert text.startswith("format: dbb-session/1\n")
    assert not seal_session(folder).anything
    assert sound(folder)


def test_a_run_of_the_future_is_not_sealed(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(SESSIONS / "small", tmp_path / "small"))
    file = folder / "session.yaml"
    file.write_text(re.sub(r"started: \d{4}", "started: 2096", file.read_text("utf-8"), count=1), "utf-8")
    refused = call("session", "seal", folder)
    assert refused.code == FAILED
    assert re.search(r"is of 2096-\d\d-\d\d, which is still to come: it is not sealed", refused.err)


def test_readings_that_are_written_in_are_no_change_and_those_that_are_changed_are(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(SESSIONS / "under-spindle", tmp_path / "session"))
    entry = re.search(r"  - \{test: g, mounting: 2, fixed.*\n", (folder / "session.yaml").read_text())[0]
    edit(folder / "session.yaml", entry, "")
    seal_session(folder)
    edit(folder / "session.yaml", "runs:\n  -", f"{entry}runs:\n  -")
    assert len(read_session(folder).set_up_errors) == 2
    edit(folder / "session.yaml", "39.0, 53.0", "39.0, 35.0")
    assert "set_up_errors of test d are not as read" in told(folder)


def test_an_anchor_that_was_noted_tells_whether_anything_before_it_was_changed(folder: Path, tmp_path: Path) -> None:
    anchor = read_session(folder).seal.log.sha256
    with SessionWriter.open(folder) as writer:
        writer.judge(writer.runs[0], accepted=False, reason="chip")
    outcome = call("check", folder, "--anchor", anchor[:16].upper())
    assert outcome.code == DONE
    assert f"the anchor {anchor[:16]} is event 25 of 26" in outcome.err
    # Whoever takes away seal and log, and seals anew, is found out by whoever noted the anchor.
    forged = Path(shutil.copytree(folder, tmp_path / "forged"))
    (forged / EVENTS_FILE).unlink()
    text = (forged / "session.yaml").read_text(encoding="utf-8")
    bare = re.sub(r", chain_sha256: [0-9a-f]{64}", "", re.sub(r"seal:\n(  .*\n)+", "", text))
    (forged / "session.yaml").write_text(re.sub("    chain_sha256: .*\n", "", bare), encoding="utf-8")
    seal_session(forged)
    assert sound(forged)
    outcome = call("check", forged, "--anchor", anchor)
    assert outcome.code == FAILED
    assert "is not in this session" in outcome.err
    assert call("check", forged, "--anchor", "abc").code == 2


def test_the_log_is_listed_with_reasons_and_anchor(folder: Path) -> None:
    listed = call("session", "log", folder, "--json").data
    assert listed["anchor"] == read_session(folder).seal.log.sha256
    assert [(e["what"], e["about"]) for e in listed["events"][6:8]] == [
        ("rejected", "a-cw-1: operator"),
        ("run started", "a-cw-2"),
    ]
    assert call("session", "log", folder).out.endswith(f"anchor {listed['anchor']}\n")


def test_a_link_in_the_place_of_the_copies_is_not_followed(folder: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "letter.txt").write_text("dear", encoding="utf-8")
    shutil.rmtree(folder / "sealed")
    (folder / "sealed").symlink_to(elsewhere)
    outcome = call("check", folder)
    assert outcome.code == FAILED
    assert "sealed is a link: the copies of what was sealed are part of the session" in outcome.err
    assert "letter" not in outcome.err
    outcome = call("session", "seal", folder)
    assert outcome.code == FAILED
    assert "a link in the session leads out of it" in outcome.err
    assert [path.name for path in elsewhere.iterdir()] == ["letter.txt"]


@pytest.mark.parametrize(("back_s", "said"), [(1, False), (2, True), (18000, True)])
def test_a_clock_that_was_set_back_is_told(folder: Path, back_s: int, said: bool) -> None:  # noqa: FBT001
    last = read_event_log(folder, []).events[-1].at
    with SessionWriter.open(folder, clock=lambda: last - timedelta(seconds=back_s)) as writer:
        writer.note(Note(BEGUN, "gate closed"))
        writer.note(Note(BEGUN, "gate open"))
    outcome = call("check", folder)
    assert outcome.code == DONE
    assert outcome.err.count(f"the clock was set back by {back_s} s before event 26 (noted)") == said
    assert outcome.err.count("the clock was set back") == said


def test_a_backup_made_of_links_keeps_what_it_held(folder: Path, tmp_path: Path) -> None:
    """As `cp -al` and `rsync --link-dest` make it: a log that is continued in place would continue the backup's."""
    backup = Path(shutil.copytree(folder, tmp_path / "backup", copy_function=os.link))
    before = {path.relative_to(backup): path.read_bytes() for path in backup.rglob("*") if path.is_file()}
    with SessionWriter.open(folder) as writer:
        judged = writer.judge(writer.runs[0], accepted=False, reason="chip")
        writer.note(Note(BEGUN, "gate closed"))
    assert {name: (backup / name).read_bytes() for name in before if name.name != ".lock"} == {
        name: data for name, data in before.items() if name.name != ".lock"
    }
    assert read_session(backup).runs[0].state is RunState.ACCEPTED
    assert read_session(folder).runs[0] == judged
    assert (folder / EVENTS_FILE).read_bytes().startswith(before[Path(EVENTS_FILE)])


@pytest.mark.parametrize("when", ["while it is recorded", "once it is sealed"])
def test_a_session_that_is_moved_in_mid_run_says_so_and_takes_the_run_when_it_is_back(folder: Path, when: str) -> None:
    away = folder.with_name("away")
    with SessionWriter.open(folder) as writer:
        journal = writer.start_run("a", Direction.CCW, COLUMNS, started=BEGUN)
        fill(journal, 300)
        if when == "while it is recorded":
            folder.rename(away)
            journal.sync()
            with pytest.raises(OutputError, match="was moved or deleted during the measurement; restore it"):
                writer.finish_run(journal)
        else:
            writer.finish_run(journal)
            folder.rename(away)
            with pytest.raises(OutputError, match="was moved or deleted"):
                writer.judge(writer.runs[-1], accepted=True)
    recorded = sorted(folder.glob("runs/*"))
    assert sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()) == [
        path.relative_to(folder).as_posix() for path in recorded
    ]
    for path in recorded:
        (away / "runs" / f"{path.name}.part").unlink(missing_ok=True)
        path.rename(away / "runs" / path.name)
    with SessionWriter.open(away) as writer:
        judged = writer.judge(writer.runs[-1], accepted=True)
        assert len(writer.session.load(judged).recording.t_s) == 300
    assert sound(away)


def test_a_part_that_was_removed_while_it_is_recorded_is_written_anew(folder: Path) -> None:
    with SessionWriter.open(folder) as writer:
        journal = writer.start_run("a", Direction.CCW, COLUMNS, started=BEGUN)
        fill(journal, 300)
        journal.path.unlink()
        journal.sync()
        assert journal.path.read_bytes().count(b"\n") == 304
        journal.path.unlink()
        journal.path.write_text("somebody else's\n", encoding="utf-8")
        for index in range(300, 700):
            journal.append((index / 10, 150.0))
        done = writer.finish_run(journal)
    assert len(read_session(folder).load(done).recording) == 700
    (other,) = (folder / "runs").glob("*.foreign-*")
    assert other.read_text(encoding="utf-8") == "somebody else's\n"


def test_a_dead_run_whose_file_is_gone_is_no_fault_of_the_session(folder: Path) -> None:
    (folder / "runs" / "l-cw-2.csv.part").unlink()
    outcome = call("check", folder)
    assert outcome.code == DONE
    assert "l-cw-2.csv.part: there is no such file" in outcome.err
