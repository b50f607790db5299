"""`dbbstation history`: trends of a folder of sessions, odd folders, and what it writes."""

from __future__ import annotations

import csv
import hashlib
import html.parser
import os
import re
import shutil
import sqlite3
from datetime import UTC, datetime, timedelta

import pytest

from dbbstation.cli import DONE, FAILED
from dbbstation.cli.history import history
from dbbstation.files.kept import index_file
from dbbstation.files.places import shipped_folder
from dbbstation.history.trend import FALSE_ALARMS
from dbbstation.tasks.session_figures import session_figures
from tests.cli.conftest import call
from tests.sessions_over_time import sessions_over_time

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
COUNT, STEP_AT, STEP_UM = 14, 12, 12.0


@pytest.fixture(autouse=True)
def cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "history-cache"))


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    """Fourteen weeks of one test; in the last two the centre stands 12 µm further in X."""
    folder = tmp_path_factory.mktemp("history") / "sessions"
    sessions_over_time(folder, COUNT, seed=2, step_at=STEP_AT, step_um=STEP_UM)
    return folder


@pytest.fixture(scope="module")
def told(sessions, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "history-cache"))
        outcome = call("history", sessions, "--json")
    assert outcome.code == DONE, outcome.err
    return outcome


@pytest.fixture
def few(sessions, tmp_path):
    for name in ("w001", "w002", "w003", "w004"):
        shutil.copytree(sessions / name, tmp_path / "few" / name)
    return tmp_path / "few"


def edit(folder, old, new, count=1):
    path = folder / "session.yaml"
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new, count) if count else text.replace(old, new), encoding="utf-8")


def quantity(data, label, machine=0):
    return next(one for one in data["machines"][machine]["quantities"] if one["quantity"] == label)


def test_figures_are_those_of_circles_and_evaluate(told, sessions):
    circles = call("circles", sessions / "w003", "--json").data["runs"]
    of = {(run["direction"]): run for run in circles}
    for direction in ("ccw", "cw"):
        for label, value, u in (("X", "x", "X"), ("Y", "y", "Y")):
            found = quantity(told.data, f"{label} a {direction}")["values"][2]
            assert found["session"] == "w003"
            assert found["value"] == pytest.approx(of[direction]["centre_um"][value])
            assert found["u"] == pytest.approx(of[direction]["uncertainty"][u]["u_um"])
        radial = quantity(told.data, f"R a {direction}")["values"][2]
        assert radial["value"] == pytest.approx(of[direction]["mean_radial_error_um"])
    # `evaluate` compares readings with predictions, noise included.
    left = call("evaluate", sessions / "w003", "--model", MODEL, "--json").data["runs"]
    read = {run["direction"]: run["circularity_30_upr_um"]["before"] for run in left}
    sharp = call("circles", sessions / "w003", "--filter", "30", "--json").data["runs"]
    g = next(run for run in sharp if run["direction"] == "ccw")
    assert quantity(told.data, "G a ccw")["values"][2]["value"] == pytest.approx(g["g_least_squares_um"])
    assert g["uncertainty"]["G(LS)"]["as_read_um"] == pytest.approx(read["ccw"], abs=0.01)


def test_a_moved_centre_is_found_with_its_size(told):
    """By construction: the centre of sessions 13 and 14 is 12 µm further in X, in both directions."""
    machine = told.data["machines"][0]
    (change,) = machine["changes"]
    assert (change["verdict"], change["since"]["name"], change["found"]["name"]) == ("changed", "w013", "w014")
    sizes = {one["quantity"]: one for one in change["quantities"]}
    assert set(sizes) == {"X a ccw", "X a cw"}
    for one in sizes.values():
        assert one["difference"] == pytest.approx(STEP_UM, abs=4.0 * one["u_difference"])
    assert quantity(told.data, "Y a ccw")["verdict"] == "steady"
    assert quantity(told.data, "C a ccw")["why_not"] == "watched by X and Y"


def test_each_session_has_its_date(told):
    dates = [datetime.fromisoformat(one["started"]) for one in told.data["machines"][0]["sessions"]]
    assert dates == [datetime(2017, 1, 2, 8, tzinfo=UTC) + timedelta(weeks=k) for k in range(COUNT)]


def test_the_table_and_the_json_hold_the_same_numbers(told, sessions, tmp_path):
    assert call("history", sessions, "--table", tmp_path / "h.csv").code == DONE
    with (tmp_path / "h.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    every = [(q["quantity"], v) for q in told.data["machines"][0]["quantities"] for v in q["values"]]
    assert [(row["quantity"], row["session"]) for row in rows] == [(q, v["session"]) for q, v in every]
    for row, (_, value) in zip(rows, every, strict=True):
        assert float(row["value"]) == pytest.approx(value["value"], rel=1e-8)
        assert bool(row["z"]) is (value["z"] is not None)
        assert float(row["z"] or 0.0) == pytest.approx(value["z"] or 0.0, rel=1e-8)
    assert (tmp_path / "h.csv.provenance.json").exists()
    refused = call("history", sessions, "--table", tmp_path / "h.csv")
    assert (refused.code, "exists already" in refused.err) == (FAILED, True)
    assert call("history", sessions, "--table", tmp_path / "h.csv", "--force").code == DONE


def test_the_second_time_says_the_same_and_reads_no_recording(told, sessions, monkeypatch):
    def refuse(*_):
        raise AssertionError("a session was read")

    monkeypatch.setattr("dbbstation.tasks.session_figures.session_figures", refuse)
    again = call("history", sessions, "--json")
    assert again.out == told.out


def test_a_session_file_that_was_only_touched_is_known_by_its_content(few, monkeypatch):
    before = call("history", few, "--json").out
    (few / "w002" / "session.yaml").touch()
    shutil.move(few / "w003", few / "w003 moved")
    monkeypatch.setattr("dbbstation.tasks.session_figures.session_figures", None)
    assert call("history", few, "--json").out.replace("w003 moved", "w003") == before


def test_what_was_read_before_an_interrupt_is_not_read_again(few, monkeypatch):
    real, read = session_figures, []

    def third_time(folder):
        read.append(folder.name)
        if len(read) == 3:
            raise KeyboardInterrupt
        return real(folder)

    monkeypatch.setattr("dbbstation.tasks.session_figures.session_figures", third_time)
    assert call("history", few).code == FAILED
    assert call("history", few).code == DONE
    assert read == ["w001", "w002", "w003", "w003", "w004"]


def test_several_processes_give_the_same(few, monkeypatch):
    shutil.copytree(few / "w002", few / "w002 copy")
    run = few / "w003" / "runs" / "a-cw-2.csv"
    run.write_bytes(run.read_bytes()[:-40])
    before = call("history", few, "--json")
    monkeypatch.setattr("dbbstation.tasks.histories.RUNS_WORTH_PROCESSES", 1)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    monkeypatch.setattr("dbbstation.tasks.session_figures.session_figures", None)
    again = call("history", few, "--json", "--anew")
    assert (again.out, again.err) == (before.out, before.err)
    assert [one["name"] for one in again.data["left_out"]] == ["w003"]


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() == 0, reason="root may look into every folder")
def test_a_folder_that_cannot_be_looked_into_is_named(few):
    (few / "w002").chmod(0)
    try:
        outcome = call("history", few, "--json")
    finally:
        (few / "w002").chmod(0o700)
    assert [one["name"] for one in outcome.data["left_out"]] == ["w002"]


def test_a_recording_that_is_damaged_afterwards_is_noticed_at_once(few):
    before = call("history", few, "--json").data["left_out"]
    run = few / "w003" / "runs" / "a-cw-2.csv"
    run.write_bytes(run.read_bytes()[:-40])
    for more in ((), ("--anew",)):
        found = call("history", few, "--json", *more).data["left_out"]
        assert [one["name"] for one in found] == [*(one["name"] for one in before), "w003"]


def test_what_somebody_wrote_into_the_index_is_not_believed(told, sessions):
    with sqlite3.connect(index_file(sessions)) as base:
        base.execute("UPDATE kept SET text = '{\"runs\": 3}' WHERE name LIKE 'w005%'")
        base.execute("UPDATE kept SET text = 'no json' WHERE name LIKE 'w006%'")
    base.close()
    assert call("history", sessions, "--json").out == told.out


def test_the_rate_of_the_command_is_that_of_the_trends():
    """Stated twice, since help must not wait for NumPy."""
    assert {option.name: option.default for option in history.params}["false_alarms"] == FALSE_ALARMS


def test_the_terminal_says_what_changed(sessions):
    outcome = call("history", sessions)
    assert "machine PM600-0007: 14 sessions, 2017-01-02 to 2017-04-03" in outcome.out
    assert re.search(r"^  changed: w014 \(2017-04-03\), since w013 \(2017-03-27\): X a c+w", outcome.out, re.MULTILINE)


def test_the_shops_limits_are_held_against_the_last_session(few):
    (few / "dbbstation-settings.yaml").write_text(
        "format: dbb-settings/1\ntolerances:\n  - {quantity: centre-deviation, largest: 20, unit: µm, directions: [ccw]}\n"
        "  - {quantity: circular-deviation, largest: 60, unit: µm}\n",
        encoding="utf-8",
    )
    data = call("history", few, "--json").data
    assert (quantity(data, "C a ccw")["limit"], quantity(data, "C a ccw")["conformity"]) == (20.0, "exceeded")
    assert quantity(data, "C a ccw")["exceeded_sessions"] == 4
    assert quantity(data, "C a cw")["limit"] is None
    assert quantity(data, "G a cw")["conformity"] == "within"


def test_a_few_sessions_are_decided_by_stated_uncertainty(few):
    outcome = call("history", few)
    assert "Nothing changed beyond scatter and uncertainty" in outcome.out
    assert "steady, by stated U" in outcome.out
    assert quantity(call("history", few, "--json").data, "X a cw")["decided_by"] == "stated-uncertainty"


def test_the_last_of_eight_sessions_is_seen_to_be_a_tenth_of_a_millimetre_off(tmp_path):
    sessions_over_time(tmp_path / "eight", 8, seed=4, step_at=7, step_um=100.0)
    outcome = call("history", tmp_path / "eight")
    assert "1 session stands out" in outcome.out
    assert re.search(r"stands out: w008 .*X a c?cw \+100", outcome.out)


def test_one_session_cannot_tell(tmp_path):
    sessions_over_time(tmp_path / "one", 1, seed=4, step_at=1, step_um=0.0)
    outcome = call("history", tmp_path / "one")
    assert "Cannot tell whether anything changed: there is one session of each quantity" in outcome.out
    assert "cannot tell: needs 1 more session" in outcome.out


def test_a_damaged_session_is_named_and_left_out(few):
    (few / "w002" / "session.yaml").write_text("format: dbb-session/1\nruns: 7\n", encoding="utf-8")
    run = few / "w003" / "runs" / "a-cw-2.csv"
    run.write_bytes(run.read_bytes()[:-40])
    outcome = call("history", few, "--json")
    assert outcome.code == DONE
    assert [one["name"] for one in outcome.data["left_out"]] == ["w002", "w003"]
    assert [one["name"] for one in outcome.data["machines"][0]["sessions"]] == ["w001", "w004"]
    assert "left out: w002: " in outcome.err


def test_a_damaged_session_is_back_once_it_is_restored(few):
    run = few / "w003" / "runs" / "a-cw-2.csv"
    whole = run.read_bytes()
    run.write_bytes(whole[:-40])
    assert [one["name"] for one in call("history", few, "--json").data["left_out"]] == ["w003"]
    run.write_bytes(whole)
    assert call("history", few, "--json").data["left_out"] == []


def test_a_copy_of_a_session_counts_once(few):
    shutil.copytree(few / "w002", few / "w002 copy")
    outcome = call("history", few, "--json")
    assert len(outcome.data["machines"][0]["sessions"]) == 4
    assert any("w002 copy is a copy of w002" in note for note in outcome.data["notes"])


def test_each_machine_has_its_own_trends(few):
    edit(few / "w002", "PM600-0007", "PM600-0008")
    edit(few / "w003", "serial_number: PM600-0007\n", "")
    outcome = call("history", few, "--json")
    names = {one["machine"]: [s["name"] for s in one["sessions"]] for one in outcome.data["machines"]}
    assert names == {"PM600-0007": ["w001", "w004"], "PM600-0008": ["w002"], "PM-600-like reference": ["w003"]}
    assert any("w003: no serial number is noted" in note for note in outcome.data["notes"])


def test_one_direction_and_no_temperature_are_told(few):
    path = few / "w001" / "session.yaml"
    text = "\n".join(line for line in path.read_text("utf-8").splitlines() if "direction: cw" not in line)
    path.write_text(re.sub(r"ambient_temp_c.*\n", "", text) + "\n", encoding="utf-8")
    for run in (few / "w001" / "runs").glob("a-ccw*.csv"):
        lines = [re.sub(r"^((?:[^,#]*,){2})[^,]*,", r"\1", line) for line in run.read_text("utf-8").splitlines()]
        old = hashlib.sha256(run.read_bytes()).hexdigest()
        run.write_text("\n".join(lines) + "\n", encoding="utf-8")
        edit(few / "w001", old, hashlib.sha256(run.read_bytes()).hexdigest())
    outcome = call("history", few, "--json")
    notes = [note for note in outcome.data["notes"] if note.startswith("w001")]
    assert "w001: all its runs are ccw" in notes
    assert "w001: no temperature is noted: U lacks what the bar has grown by" in notes
    assert [len(quantity(outcome.data, f"G a {d}")["values"]) for d in ("ccw", "cw")] == [4, 3]


def test_equal_dates_and_a_clock_that_jumps_are_told(few):
    edit(few / "w002", "2017-01-09", "2017-01-02", count=0)
    edit(few / "w004", "2017-01-23T08:00:00", "2017-01-23T09:30:00")
    notes = call("history", few, "--json").data["notes"]
    assert any(note.startswith("w001 and w002 both start at 2017-01-02 08:00") for note in notes)
    assert any(note.startswith("w004: run a cw 2 is dated") and "before run a ccw 1" in note for note in notes)


def test_a_session_without_dates_has_no_place(few):
    path = few / "w002" / "session.yaml"
    path.write_text(re.sub(r" started: [^,]*,", "", path.read_text("utf-8")), encoding="utf-8")
    (left,) = call("history", few, "--json").data["left_out"]
    assert left["name"] == "w002"
    assert "no place in time" in left["problem"]


@pytest.mark.parametrize("kind", ["none", "empty", "file", "session", "damaged"])
def test_a_folder_without_sessions_is_refused(kind, tmp_path, few):
    place = {"session": few / "w001"}.get(kind, tmp_path / kind)
    if kind in {"empty", "damaged"}:
        place.mkdir()
    if kind == "file":
        place.write_text("", encoding="utf-8")
    if kind == "damaged":
        (place / "one").mkdir()
        (place / "one" / "session.yaml").write_text("{", encoding="utf-8")
    said = {
        "none": "there is no such folder",
        "empty": "no folder in it holds a session.yaml",
        "file": "this is no folder",
        "session": "this folder is one session",
        "damaged": "none of its 1 sessions can be used",
    }
    outcome = call("history", place)
    assert outcome.code == FAILED
    assert said[kind] in outcome.err


def test_a_test_that_no_session_has_is_refused(few):
    outcome = call("history", few, "--tests", "zz")
    assert (outcome.code, "no session has a test zz; tests are a" in outcome.err) == (FAILED, True)


def model_of(session, path, **changed):
    digest = hashlib.sha256((session / "session.yaml").read_bytes()).hexdigest()
    text = MODEL.read_text("utf-8")
    text = re.sub(r"(?m)^sessions: .*$", f"sessions: {{{session.name}: {digest}}}", text)
    for old, new in changed.items():
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def test_parameters_come_from_models_of_one_session(few):
    for k, name in enumerate(("w001", "w002", "w003")):
        model_of(few / name, few / f"{name}.yaml")
        text = (few / f"{name}.yaml").read_text("utf-8").replace("value: 0.01494", f"value: {0.01494 + 0.001 * k}")
        (few / f"{name}.yaml").write_text(text, encoding="utf-8")
    shutil.copy(few / "w002.yaml", few / "again.yaml")
    shutil.copy(MODEL, few / "elsewhere.yaml")
    data = call("history", few, "--json").data
    found = quantity(data, "strut-reference-length strut 2")
    assert [one["value"] for one in found["values"]] == pytest.approx([14.94, 15.94, 16.94])
    assert [one["u"] for one in found["values"]] == pytest.approx([1e3 * 7.395e-8**0.5] * 3)
    assert found["unit"] == "µm"
    assert any("w002.yaml and again.yaml are of one session" in note for note in data["notes"])
    assert any("elsewhere.yaml comes from a session small that is not here" in note for note in data["notes"])


class Page(html.parser.HTMLParser):
    """Balance of a page, its references and its texts."""

    def __init__(self):
        super().__init__()
        self.open, self.idents, self.links, self.foreign = [], set(), set(), []

    def handle_starttag(self, tag, attrs):
        if tag not in {"meta", "br"}:
            self.open.append(tag)
        for name, value in attrs:
            self.idents |= {value} if name == "id" else set()
            self.links |= {value} if name == "href" else set()
            self.foreign += [value] if name == "src" else []

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_stands_alone_and_draws_every_quantity(sessions, told, tmp_path):
    assert call("history", sessions, "--page", tmp_path / "h.html").code == DONE
    text = (tmp_path / "h.html").read_text("utf-8")
    page = Page()
    page.feed(text)
    assert (page.open, page.foreign) == ([], [])
    assert "<script" not in text
    assert "http" not in text
    assert {link.removeprefix("#") for link in page.links} <= page.idents
    assert text.count("<svg") == len(told.data["machines"][0]["quantities"])
    assert text.count('class="event changed"') == 2
    again = tmp_path / "again.html"
    assert call("history", sessions, "--page", again).code == DONE
    assert again.read_text("utf-8") == text


def test_what_people_typed_is_escaped(few, tmp_path):
    evil = "<script>alert(1)</script>"
    for folder in few.iterdir():
        edit(folder, "PM600-0007", evil)
    shutil.move(few / "w002", few / "<b>w")
    assert call("history", few, "--page", tmp_path / "h.html").code == DONE
    text = (tmp_path / "h.html").read_text("utf-8")
    assert "<script" not in text
    assert "<b>w" not in text
    assert "&lt;script&gt;alert(1)" in text


def test_a_result_never_takes_the_place_of_a_session_file(few):
    target = few / "w001" / "session.yaml"
    before = target.read_bytes()
    outcome = call("history", few, "--page", target, "--force")
    assert outcome.code == FAILED
    assert target.read_bytes() == before
