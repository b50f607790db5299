"""`fleet`: one task on many sessions; what fails is named, what is up to date is not done again, what is interrupted goes on."""

from __future__ import annotations

import csv
import json
import re
import shutil

import pytest

from dbbstation.cli import DONE, FAILED, USAGE
from dbbstation.errors import OutputError
from dbbstation.files import keys
from dbbstation.files.fleet_folder import FleetFolder
from dbbstation.results.fleet import TABLE
from dbbstation.tasks import fleet as fleet_module
from dbbstation.tasks.fleet import fleet
from dbbstation.tasks.telling import StoppedError
from tests.cli.conftest import call
from tests.cli.test_report_command import Page
from tests.tasks.fleet_sessions import machines

COUNT = 4
ONE_TEST = fleet_module.FleetOptions({"tests": ("a",)})


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return machines(tmp_path_factory.mktemp("fleet") / "sessions", COUNT)


@pytest.fixture
def sessions(recorded, tmp_path):
    return shutil.copytree(recorded, tmp_path / "sessions")


@pytest.fixture(scope="module")
def calibrated(recorded, tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrated")
    sessions = shutil.copytree(recorded, folder / "sessions")
    spoilt = sessions / "m01" / "runs" / "a-ccw-1.csv"
    spoilt.write_text(spoilt.read_text("utf-8") + "1,2,3,4,5,6,7\n", "utf-8")
    outcome = call("fleet", sessions, "--task", "calibrate", "--out", folder / "out", "--jobs", "2", "--json")
    return folder, outcome


class InThisProcess:
    """A pool that works here: to start processes takes seconds, and `test_executors.py` and the tests of whole commands do it."""

    def __init__(self, *_):
        pass

    def each(self, work, pieces):
        yield from enumerate(map(work, pieces))


@pytest.fixture
def here(monkeypatch):
    monkeypatch.setattr(fleet_module, "WorkPool", InThisProcess)


def states(result):
    return {one.session: one.state for one in result.sessions}


def test_a_session_that_fails_is_named_and_the_others_are_done(calibrated):
    folder, outcome = calibrated
    assert outcome.code == FAILED
    assert "failed: m01: " in outcome.err
    found = {one["session"]: one for one in outcome.data["sessions"]}
    assert {name: one["state"] for name, one in found.items()} == {
        "m00": "done",
        "m01": "failed",
        "m02": "done",
        "m03": "done",
    }
    assert "a-ccw-1.csv" in found["m01"]["problem"]
    assert found["m00"]["machine"] == "M00"
    for name in ("m00", "m02", "m03"):
        assert all((folder / "out" / file).is_file() for file in found[name]["files"])


def test_what_a_session_gives_is_what_its_own_command_gives(calibrated):
    folder, outcome = calibrated
    (file, model) = next(one["files"] for one in outcome.data["sessions"] if one["session"] == "m00")
    kept = json.loads((folder / "out" / file).read_text("utf-8"))["result"]
    alone = call("calibrate", folder / "sessions" / "m00", "--json", "--out", folder / "alone.yaml").data
    for key in ("parameters_identified", "residual_rms_um", "runs", "covariance"):
        assert kept[key] == alone[key]
    assert call("check", folder / "out" / model).code == DONE


def test_one_table_has_every_value_and_one_page_a_row_for_each_machine(calibrated):
    folder, outcome = calibrated
    rows = list(csv.DictReader((folder / "out" / "calibrate.csv").read_text("utf-8").splitlines()))
    assert tuple(rows[0]) == TABLE
    for one in outcome.data["sessions"]:
        own = [row for row in rows if row["session"] == one["session"]]
        assert [(row["quantity"], row["unit"]) for row in own if row["quantity"]] == [
            (value["quantity"], value["unit"]) for value in one["values"]
        ]
    (failed,) = [row for row in rows if row["session"] == "m01"]
    assert (failed["state"], failed["value"]) == ("failed", "")
    page = Page((folder / "out" / "calibrate.html").read_text("utf-8"))
    for name in ("M00", "m01", "M02", "M03"):  # the file of m01 was changed: nobody knows whose it is
        assert f" {name} " in page.text
    assert "3 of 4 sessions done, 1 failed" in page.text
    assert page.tags.count("svg") == COUNT - 1  # what failed has no scores


@pytest.mark.usefixtures("here")
def test_what_is_up_to_date_is_not_done_again(sessions, tmp_path, monkeypatch):
    out = tmp_path / "out"

    def again(options=ONE_TEST, **how):
        return states(fleet([sessions], "circles", out, options=options, **how))

    assert set(again().values()) == {"done"}
    assert set(again().values()) == {"up-to-date"}
    # Another recording, another option, another program, or the wish: each is done anew, and nothing else.
    path = sessions / "m02" / "session.yaml"
    path.write_text(path.read_text("utf-8").replace("ambient_temp_c: 20.0", "ambient_temp_c: 21.0"), "utf-8")
    assert again() == {"m00": "up-to-date", "m01": "up-to-date", "m02": "done", "m03": "up-to-date"}
    assert set(again(fleet_module.FleetOptions({"tests": ("a",), "findings": True})).values()) == {"done"}
    assert set(again().values()) == {"up-to-date"}
    assert set(again(anew=True).values()) == {"done"}
    own = fleet_module.program_identity()
    for module in (fleet_module, keys):
        monkeypatch.setattr(module, "program_identity", lambda: {**own, "code": "0" * 64})
    with pytest.raises(Exception, match="another program"):
        again()


def test_an_interruption_goes_on_where_it_stopped(sessions, tmp_path):
    done = []

    def stop():
        return len(done) > 2

    with pytest.raises(StoppedError):
        fleet(
            [sessions],
            "circles",
            tmp_path / "out",
            options=ONE_TEST,
            stop=stop,
            progress=lambda *told: done.append(told),
        )
    kept = [path.name for path in (tmp_path / "out" / "circles").glob("*.json")]
    assert 0 < len(kept) < COUNT
    again = states(fleet([sessions], "circles", tmp_path / "out", options=ONE_TEST))
    assert sorted(again.values()) == ["done"] * (COUNT - len(kept)) + ["up-to-date"] * len(kept)


@pytest.mark.usefixtures("here")
def test_half_a_result_is_no_result(sessions, tmp_path):
    fleet([sessions], "circles", tmp_path / "out", options=ONE_TEST)
    path = next((tmp_path / "out" / "circles").glob("m03-*.json"))
    path.write_text(path.read_text("utf-8")[:100], "utf-8")
    assert states(fleet([sessions], "circles", tmp_path / "out", options=ONE_TEST))["m03"] == "done"


@pytest.mark.usefixtures("here")
def test_copies_are_done_once(sessions, tmp_path):
    shutil.copytree(sessions / "m00", sessions / "m00-copy")
    notes = []
    result = fleet([sessions], "circles", tmp_path / "out", options=ONE_TEST, say=notes.append)
    assert [one.session for one in result.sessions] == ["m00", "m01", "m02", "m03"]
    assert any("m00-copy is a copy of m00" in one for one in notes)


@pytest.mark.usefixtures("here")
def test_a_machine_of_another_geometry_is_compared_in_figures_only_and_that_is_said(sessions, tmp_path):
    """Its frame is higher by 10 mm: its circles are circles as well, its parameters are departures from another nominal machine."""
    path = sessions / "m03" / "machine.yaml"
    text = path.read_text("utf-8")
    number = re.search(r"-?\d+\.\d{3,}", text)
    path.write_text(text[: number.start()] + f"{float(number[0]) + 1e-2:.6f}" + text[number.end() :], "utf-8")
    result = fleet([sessions], "calibrate", tmp_path / "out")
    assert any(note.startswith("M03: another nominal machine than M00") for note in result.comparison.notes)
    of = {
        one.machine: one.sisters
        for one in result.comparison.scored
        if one.quantity.startswith("strut-reference-length")
    }
    assert (of["M00"], of["M03"]) == (COUNT - 2, 0)
    figures = {one.machine: one.sisters for one in result.comparison.scored if one.kind == "figure"}
    assert figures["M03"] == COUNT - 1


@pytest.mark.usefixtures("here")
def test_reports_and_tables_as_parquet(sessions, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    words = ["fleet", sessions, "--task", "circles", "--tests", "a", "--out", tmp_path / "out"]
    done = call(*words, "--table", tmp_path / "all.parquet")
    assert done.code == DONE, done.err
    # The CSV has nine digits.
    table = parquet.read_table(tmp_path / "all.parquet")
    rows = list(csv.DictReader((tmp_path / "out" / "circles.csv").read_text("utf-8").splitlines()))
    assert table.column_names == list(TABLE)
    assert table.column("value").to_pylist() == pytest.approx([float(row["value"]) for row in rows], rel=1e-8)
    written = call("fleet", sessions / "m00", "--task", "report", "--out", tmp_path / "reports")
    assert written.code == DONE, written.err
    assert len(list((tmp_path / "reports" / "report").glob("m00-*.html"))) == 1


@pytest.mark.usefixtures("here")
def test_sessions_without_a_serial_number_are_one_machine_or_each_its_own_and_that_is_said(sessions, tmp_path):
    for path in sessions.glob("*/session.yaml"):
        path.write_text(re.sub(r"serial_number: M\d\d\n", "", path.read_text("utf-8")), "utf-8")
    together = call("fleet", sessions, "--task", "circles", "--out", tmp_path / "out", "--tests", "a", "--json")
    (name,) = {one["machine"] for one in together.data["sessions"]}
    (note,) = together.data["notes"]
    assert note.startswith(f"{COUNT} sessions of {name} have no serial number: they are counted as one machine")
    assert note in together.err
    assert together.data["comparison"]["machines"] == 1
    page = Page((tmp_path / "out" / "circles.html").read_text("utf-8"))
    assert note in page.text
    apart = call("fleet", sessions, "--task", "circles", "--out", tmp_path / "out", "--tests", "a", "--json", "--apart")
    assert {one["machine"] for one in apart.data["sessions"]} == {f"{name} (m{k:02d})" for k in range(COUNT)}
    assert {one["state"] for one in apart.data["sessions"]} == {"up-to-date"}
    assert apart.data["comparison"]["machines"] == COUNT
    (note,) = apart.data["notes"]
    assert "each is counted as a machine of its own" in note


def test_words_that_fit_nothing_are_refused(sessions, tmp_path):
    assert call("fleet", sessions, "--task", "circles", "--sources", "gravity").code == USAGE
    assert call("fleet", sessions, "--task", "circles", "--table", tmp_path / "t.xlsx").code == USAGE
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear", "utf-8")
    done = call("fleet", sessions, "--task", "circles", "--out", tmp_path / "mine")
    assert done.code == FAILED
    assert "something lies in it" in done.err


def test_a_second_fleet_leaves_the_temporary_files_of_the_first(tmp_path):
    half = tmp_path / "out" / "calibrate" / ".m01.json.k3f.new"
    with FleetFolder(tmp_path / "out", "calibrate"):
        half.write_text("half", encoding="utf-8")
        with FleetFolder(tmp_path / "out", "calibrate"):
            assert half.exists()
    with FleetFolder(tmp_path / "out", "calibrate"):
        assert not half.exists()


def test_a_fleet_that_was_ended_before_its_mark_goes_on(tmp_path):
    (tmp_path / "out").mkdir()
    for name in (".lock", ".fleet.json.k3f.new"):
        (tmp_path / "out" / name).write_text("", encoding="utf-8")
    with FleetFolder(tmp_path / "out", "calibrate") as kept:
        assert (kept.folder / "fleet.json").is_file()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "holiday.txt").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="something lies in it"):
        FleetFolder(tmp_path / "other", "calibrate")
