"""The log: where it is kept, what stands in it, and that it is never in the way."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys

import pytest

from dbbstation import __version__
from dbbstation.cli import DONE, FAILED, USAGE, log
from dbbstation.files.places import shipped_folder
from tests import copied

SMALL = shipped_folder("fixtures") / "sessions" / "small"
MODEL = shipped_folder("fixtures") / "models" / "small.yaml"
PLAN = shipped_folder("protocols") / "plans" / "table2.yaml"
MACHINE = shipped_folder("fixtures") / "machines" / "reference.yaml"
LINE = re.compile(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]\d{4} (\d+) (INFO|WARNING|ERROR) (.*)$")


@pytest.fixture
def shop(tmp_path, monkeypatch):
    """A folder with a session, whose log is kept as in a shop; and a user with an empty home."""
    monkeypatch.delenv("DBBSTATION_LOG")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "shop").mkdir()
    shutil.copytree(SMALL, tmp_path / "shop" / "small")
    return tmp_path / "shop"


def of_user(shop):
    return shop.parent / "state" / "dbbstation" / "log" / "dbbstation.log"


def lines_of(path):
    return path.read_text(encoding="utf-8").splitlines()


def test_it_stands_in_the_users_folder_with_command_versions_inputs_notes_and_end(run, shop):
    assert run("evaluate", shop / "small", "--model", MODEL).code == DONE
    found = [LINE.match(line) for line in lines_of(of_user(shop))]
    assert all(found)
    told = [match[3] for match in found]
    assert told[0] == f"$ dbbstation evaluate {shop / 'small'} --model {MODEL}"
    assert re.match(rf"dbbstation {re.escape(__version__)}, Python \d+\.\d+\.\d+, ", told[1])
    assert re.search(r"numpy \d.*scipy \d", told[2])
    for path in (MODEL, *(shop / "small" / f"{name}.yaml" for name in ("session", "machine", "plan"))):
        assert f"read {path}, sha256 {hashlib.sha256(path.read_bytes()).hexdigest()}" in told
    assert "note: small: run l cw 2 is recording, not accepted: left out" in told
    assert re.match(r"done in \d+\.\d s$", told[-1])


def test_every_command_continues_it(run, shop):
    for _ in range(2):
        assert run("session", "list", shop / "small").code == DONE
    assert sum("$ dbbstation session list" in line for line in lines_of(of_user(shop))) == 2


def test_nothing_is_written_beside_what_is_read_or_made(run, shop):
    new = shop / "new"
    words = ("--plan", PLAN, "--machine", MACHINE, "--instrument", "heidenhain-nd281b", "--port", "no", "--out", new)
    run("measure", *words)
    assert run("circles", shop / "small").code == DONE
    assert {path.name for path in shop.iterdir()} <= {"small", "new"}
    assert not list(shop.rglob("dbbstation.log"))
    told = [match[3] for line in lines_of(of_user(shop)) if (match := LINE.match(line))]
    assert {"$ dbbstation measure", "$ dbbstation circles"} <= {" ".join(line.split()[:3]) for line in told}


def test_a_log_that_can_be_written_nowhere_is_no_reason_to_fail(run, shop):
    of_user(shop).mkdir(parents=True)  # a folder in the place of the log: cannot be opened, by root either
    assert run("session", "list", shop / "small").code == DONE


@pytest.mark.parametrize("named", ["off", "file"])
def test_the_environment_names_another_or_none(run, shop, monkeypatch, named):
    other = shop.parent / "elsewhere" / "log.txt"
    monkeypatch.setenv("DBBSTATION_LOG", "off" if named == "off" else str(other))
    assert run("session", "list", shop / "small").code == DONE
    assert other.is_file() is (named == "file")
    assert not of_user(shop).exists()


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of Unix")
@pytest.mark.parametrize("how", ["link", "second name", "pipe", "named in the environment"])
def test_it_is_written_into_no_recording_and_waits_for_no_pipe(run, shop, monkeypatch, how):
    log, recording = of_user(shop), shop / "small" / "runs" / "a-ccw-1.csv"
    before = recording.read_bytes()
    log.parent.mkdir(parents=True)
    if how == "link":
        log.symlink_to(recording)
    elif how == "second name":
        log.hardlink_to(recording)
    elif how == "pipe":
        os.mkfifo(log)
    else:
        monkeypatch.setenv("DBBSTATION_LOG", str(recording))
    for _ in range(2):
        assert run("session", "list", shop / "small").code == DONE
    assert recording.read_bytes() == before
    assert log.exists() == (how != "named in the environment")


def test_a_fault_stands_there_with_its_traceback_and_the_terminal_has_one_line(run, shop):
    (shop / "small" / "plan.yaml").unlink()
    outcome = run("evaluate", shop / "small", "--model", MODEL)
    assert outcome.code == FAILED
    assert "Traceback" not in outcome.err
    text = of_user(shop).read_text(encoding="utf-8")
    assert re.search(r" ERROR failed after \d+\.\d s\nTraceback ", text)
    assert re.search(r"InputError: .*plan\.yaml: there is no such file", text)


def test_what_is_wrong_with_the_program_itself_stands_there_too(run, shop, monkeypatch):
    monkeypatch.setattr("dbbstation.files.recordings.session.read_session", lambda _: 1 / 0)
    assert run("session", "list", shop / "small").code == FAILED
    assert "ZeroDivisionError: division by zero" in of_user(shop).read_text(encoding="utf-8")


def test_an_interruption_is_noted(run, shop, monkeypatch):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("dbbstation.files.recordings.session.read_session", interrupted)
    assert run("session", "list", shop / "small").code == FAILED
    assert re.search(r" WARNING interrupted after \d+\.\d s$", lines_of(of_user(shop))[-1])


def test_it_is_turned_over_and_never_fills_a_disk(run, shop, monkeypatch):
    monkeypatch.setattr(log, "LARGEST_BYTES", 2_000)
    for _ in range(30):
        assert run("session", "list", shop / "small").code == DONE
    logs = sorted(of_user(shop).parent.glob("dbbstation.log*"))
    assert [path.name for path in logs] == ["dbbstation.log", *(f"dbbstation.log.{k}" for k in range(1, log.KEPT + 1))]
    assert max(path.stat().st_size for path in logs) <= 2_000


@pytest.mark.parametrize("place", ["before", "after"])
def test_verbose_shows_it_and_nothing_twice(run, shop, place):
    words = ["evaluate", shop / "small", "--model", MODEL, "--json"]
    outcome = run(*(["--verbose", *words] if place == "before" else [*words, "--verbose"]))
    assert outcome.code == DONE
    assert outcome.data["runs"]  # standard output is the result alone
    assert f"log: read {MODEL}, sha256 " in outcome.err
    assert outcome.err.count("run l cw 2 is recording, not accepted") == 1


def test_without_verbose_nothing_of_it_is_shown(run, shop):
    assert "sha256" not in run("evaluate", shop / "small", "--model", MODEL).err


def test_help_and_misspelt_commands_keep_no_log(run, shop):
    assert run("evaluate", "--help").code == DONE
    assert run("evaluat").code == USAGE
    assert not of_user(shop).exists()


def test_nothing_stays_open_behind_a_command(run, shop):
    before = list(log.LOG.handlers), log.LOG.level
    run("session", "list", shop / "small")
    assert (list(log.LOG.handlers), log.LOG.level) == before


@pytest.mark.usefixtures("copies")
def test_the_stages_of_long_work_stand_there(shop):
    done = copied.done(["diagnose", shop / "small", "--sources", "gravity"])
    assert done.returncode == DONE, done.stderr
    told = [LINE.match(line)[3] for line in lines_of(of_user(shop))]
    assert "... kinematic calibration" in told
    assert "... held-out tests" in told
