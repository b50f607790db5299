"""One writer for each session: a second one is refused while the first lives, and not after it died."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

from dbbstation.errors import InputError, OutputError
from dbbstation.files.checking import check
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.formats.plan import read_inline_plan
from dbbstation.files.formats.session import RunState
from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.lock import LOCK_FILE, SessionLock
from dbbstation.files.recordings.session import unlisted_sealed
from dbbstation.files.recordings.session_writer import SessionWriter
from dbbstation.plan.plan import Direction
from tests.files.recordings.test_session_writer import BEGUN, COLUMNS, fill

HOLD = """
import sys, time
from pathlib import Path
from dbbstation.files.recordings.lock import SessionLock
lock = SessionLock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(60)
"""


@pytest.fixture
def folder(tmp_path):
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml")
    plan = read_inline_plan(shipped_folder("protocols") / "plans" / "ten-minute-check.yaml")
    with SessionWriter.create(tmp_path / "session", machine, plan) as writer:
        return writer.session.folder


def test_another_process_is_refused_until_the_first_one_dies(folder):
    with subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(OutputError, match=f"process {other.pid} on .* writes into this session"):
            SessionWriter.open(folder)
        other.send_signal(signal.SIGKILL)
    SessionWriter.open(folder).close()


def test_a_writer_that_was_closed_lets_the_next_one_in(folder):
    with SessionWriter.open(folder), pytest.raises(OutputError, match="writes into this session"):
        SessionLock(folder)
    SessionWriter.open(folder).close()


def test_a_link_in_the_place_of_the_lock_is_not_followed(folder, tmp_path):
    (folder / LOCK_FILE).unlink()
    (folder / LOCK_FILE).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OutputError, match="cannot be written"):
        SessionLock(folder)
    assert not (tmp_path / "elsewhere").exists()


def test_what_is_no_session_gets_no_lock(tmp_path):
    (tmp_path / "holiday").mkdir()
    with pytest.raises(InputError):
        SessionWriter.open(tmp_path / "holiday")
    assert not list((tmp_path / "holiday").iterdir())


def test_a_sealed_run_in_no_list_is_named_and_taken_in(folder):
    with SessionWriter.open(folder) as writer:
        test = next(iter(writer.session.plan.tests))
        before = {name: (folder / name).read_bytes() for name in ("session.yaml", "events.log")}
        journal = writer.start_run(test, Direction.CCW, COLUMNS, started=BEGUN)
        fill(journal)
        writer.finish_run(journal)
    for name, data in before.items():  # both from a backup
        (folder / name).write_bytes(data)
    (warning,) = [w for w in check(folder, {}).warnings if "in no list" in w.what]
    assert warning.file.endswith(f"runs/{test}-ccw-1.csv")
    with SessionWriter.open(folder) as writer:
        (path,) = unlisted_sealed(writer.session)
        entry = writer.take_in(path)
        assert (entry.state, entry.label) == (RunState.COMPLETE, f"{test} ccw 1")
        assert not unlisted_sealed(writer.session)
        with pytest.raises(InputError, match="lists another run"):
            writer.take_in(path)


def test_temporary_files_of_a_power_cut_go_at_the_next_start(folder):
    left = [folder / ".session.yaml.k3f.new", folder / "runs" / ".x.new", folder / "sealed" / ".machine-k3f.yaml.new"]
    before = check(folder, {})
    for path in left:
        path.write_text("half", encoding="utf-8")
    assert check(folder, {}) == before  # a leftover is no spoilt evidence
    SessionWriter.open(folder).close()
    assert not any(path.exists() for path in left)


def test_a_reading_is_on_the_disk_within_a_second_though_no_other_comes(folder, monkeypatch):
    synced: list[float] = []
    monkeypatch.setattr("dbbstation.files.recordings.journal.os.fsync", lambda _: synced.append(time.monotonic()))
    with SessionWriter.open(folder) as writer:
        journal = writer.start_run(next(iter(writer.session.plan.tests)), Direction.CCW, COLUMNS, started=BEGUN)
        begun = time.monotonic()
        journal.append((0.0, 150.0))
        count = len(synced)
        while time.monotonic() < begun + 1.3:
            journal.sync_if_due()
            time.sleep(0.005)
        journal.close()
    assert len(synced) > count
    assert min(t for t in synced[count:]) < begun + 1.2
