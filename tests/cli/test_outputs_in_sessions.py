"""No command writes into a session folder, whatever stands there and whatever `--force` says; a full disk says its cause last."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import click
import pytest

from dbbstation.cli import FAILED, cli
from dbbstation.errors import OutputError
from dbbstation.files.atomic import refuse_existing, write_folder, write_text
from dbbstation.files.places import session_around, shipped_folder
from dbbstation.files.recordings.new_session import write_session
from dbbstation.files.recordings.session import read_session
from tests.cli.conftest import call

FIXTURES, PLANS = shipped_folder("fixtures"), shipped_folder("protocols") / "plans"
MACHINE, MODEL = FIXTURES / "machines" / "reference.yaml", FIXTURES / "models" / "small.yaml"
DRIVE, TABLE = FIXTURES / "drives" / "strut.csv", FIXTURES / "tables" / "axis.csv"
PENDULUM = FIXTURES / "simulators"
RUN = "runs/a-ccw-1.csv"

OF_FILES = {
    "calibrate --out": ["calibrate", "{h}/one", "--out"],
    "calibrate --figure": ["calibrate", "{h}/one", "--figure"],
    "circles --table": ["circles", "{h}/one", "--table"],
    "compare --figure": ["compare", "{h}/one", "{h}/one", "--figure"],
    "compensate --out": ["compensate", FIXTURES / "programs" / "none.ngc", "--model", MODEL, "--out"],
    "diagnose --out": ["diagnose", "{h}/one", "--out"],
    "diagnose --figure": ["diagnose", "{h}/one", "--figure"],
    "identify --table": ["identify", DRIVE, "--table"],
    "identify --figure": ["identify", DRIVE, "--figure"],
    "export --out": ["export", "{h}/one", "--out"],
    "history --page": ["history", "{h}", "--page"],
    "history --table": ["history", "{h}", "--table"],
    "mismatch --table": ["mismatch", TABLE, "--measured", "measured_um", "--simulated", "simulated_um", "--table"],
    "mismatch --out": ["mismatch", PENDULUM / "pendulum.csv", "--simulator", PENDULUM / "pendulum.yaml", "--out"],
    "mismatch --figure": ["mismatch", TABLE, "--measured", "measured_um", "--simulated", "simulated_um", "--figure"],
    "circles --figure": ["circles", "{h}/one", "--figure"],
    "predict --table": ["predict", "--model", MODEL, TABLE, "--table"],
    "report --page": ["report", "{h}/one", "--page"],
    "report --pdf": ["report", "{h}/one", "--page", "{h}/report.html", "--pdf"],
}
"""Commands that write a file, with all that they need before its name."""

ELSEWHERE = {
    "bar --out", "demo --out", "import --out", "import --mapping", "jig holders --out", "jig sheet --out", "measure --out",
    "fleet --out", "fleet --table", "measure --spy", "control kinematics --out",
    "control parameters --out", "instrument monitor --log", "instrument monitor --spy", "program --out", "simulate --out",
}  # fmt: skip
"""Options whose command needs an instrument or long work before it writes, or that make a session: what they write through is
tested by itself."""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def shop(tmp_path: Path) -> Path:
    shutil.copytree(FIXTURES / "sessions" / "logged", tmp_path / "h" / "one")
    return tmp_path / "h"


def content(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != ".lock"}


def outputs() -> set[str]:
    found = set()

    def look(group: click.Group, before: tuple[str, ...]) -> None:
        for name in group.list_commands(click.Context(group)):
            command = group.get_command(click.Context(group), name)
            if isinstance(command, click.Group):
                look(command, (*before, name))
                continue
            for option in command.params:
                names = [word for word in option.opts if word in WRITING]
                found.update(f"{' '.join((*before, name))} {word}" for word in names)

    look(cli, ())
    return found


WRITING = {"--out", "--table", "--page", "--figure", "--pdf", "--spy", "--log", "--mapping"}


def test_every_option_that_names_an_output_is_in_the_table():
    assert outputs() == OF_FILES.keys() | ELSEWHERE


@pytest.mark.parametrize("option", OF_FILES)
def test_nothing_is_written_into_a_session(shop: Path, option: str) -> None:
    target = "new.svg" if option.endswith("--figure") else RUN
    before = content(shop / "one")
    words = [str(word).replace("{h}", str(shop)) for word in OF_FILES[option]]
    outcome = call(*words, shop / "one" / target, "--force")
    assert outcome.code == FAILED
    assert f"lies in the session {(shop / 'one').resolve()}" in outcome.err
    assert content(shop / "one") == before


def test_what_all_of_them_write_through_refuses_it_too(shop: Path, tmp_path: Path) -> None:
    session = read_session(shop / "one")
    (tmp_path / "link").symlink_to(shop / "one" / "runs")
    for write in (
        lambda: write_text(shop / "one" / "x.html", "", force=True),
        lambda: write_text(tmp_path / "link" / "a-ccw-1.csv", "", force=True),
        lambda: write_folder(shop / "one" / "programs", {"a.ngc": ""}, force=True),
        lambda: write_folder(shop / "one" / "new", {"a.ngc": ""}),
        lambda: refuse_existing(shop / "one" / "session.yaml", force=True),
        lambda: write_session(shop / "one" / "inner", session.machine, session.plan, ()),
    ):
        with pytest.raises(OutputError, match="lies in the session"):
            write()
    assert session_around(shop / "report.html") is None


def test_a_byte_log_goes_elsewhere_too(shop: Path) -> None:
    outcome = call(
        "instrument",
        "monitor",
        "--instrument",
        "heidenhain-nd281b",
        "--port",
        "none",
        "--spy",
        shop / "one" / RUN,
        "--force",
    )
    assert outcome.code != 0
    assert (shop / "one" / RUN).read_bytes() == (FIXTURES / "sessions" / "logged" / RUN).read_bytes()


def test_sealed_runs_and_copies_may_only_be_read(tmp_path: Path) -> None:
    outcome = call(
        "simulate",
        "--model",
        MODEL,
        PLANS / "ten-minute-check.yaml",
        "--out",
        tmp_path / "s",
    )
    assert outcome.code == 0, outcome.err
    files = [*(tmp_path / "s" / "runs").iterdir(), *(tmp_path / "s" / "sealed").iterdir()]
    assert files
    assert not any(path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH) for path in files)


@pytest.fixture
def full(tmp_path: Path):
    disk = tmp_path / "disk"
    disk.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=600k", "none", str(disk)]
    if sys.platform != "linux" or subprocess.run(words, capture_output=True, check=False).returncode:
        pytest.skip("no small disk can be mounted here")
    try:
        shutil.copytree(FIXTURES / "sessions" / "logged", disk / "session")
        with (disk / "fill").open("wb", buffering=0) as fill:
            while True:
                try:
                    fill.write(bytes(4096))
                except OSError:
                    break
        yield disk
    finally:
        subprocess.run(["umount", str(disk)], check=True)  # noqa: S607 - where it is differs


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        (["session", "reject", "session", "a-ccw-1", "--reason", "chip"], False),
        (["circles", "session", "--table", "table.csv"], False),
        (["session", "list", "session"], True),
    ],
)
def test_a_full_disk_says_its_cause_last_and_nothing_else(full: Path, words: list[str], printed: bool) -> None:  # noqa: FBT001
    env = {key: value for key, value in os.environ.items() if key != "DBBSTATION_LOG"}
    before = content(full / "session")
    with (full / "out").open("wb") as out:
        done = subprocess.run(
            [sys.executable, "-m", "dbbstation", *words],
            cwd=full,
            env=env,
            stdout=out if printed else subprocess.PIPE,
            stderr=subprocess.PIPE,
            check=False,
        )
    told = done.stderr.decode().splitlines()
    assert done.returncode == FAILED
    assert told[-1].endswith("no space left on device; free room on the disk, then try again")
    assert not [line for line in told if "Traceback" in line or "Logging error" in line or "Errno" in line]
    assert content(full / "session") == before
