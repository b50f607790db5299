"""A simulator runs only after its user has allowed it, and again only while none of its files has changed."""

from __future__ import annotations

import re
import shutil

import pytest

from dbbstation.cli import FAILED
from dbbstation.files.places import shipped_folder
from dbbstation.simulators import allowed
from tests.cli.conftest import call

SIMULATORS = shipped_folder("fixtures") / "simulators"
KINDS = {"pendulum.yaml": "pendulum.py", "tank.yaml": "tank_program.py"}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A copy of both simulators, each of which leaves a file if it runs, and a list of nothing allowed."""
    monkeypatch.setattr(allowed, "allowed_file", lambda: tmp_path / "user" / "allowed.txt")
    folder = tmp_path / "handed-over"
    shutil.copytree(SIMULATORS, folder)
    for name in KINDS.values():
        file = folder / name
        leave = f"open({str(tmp_path / 'ran')!r}, 'w').close()\nraise SystemExit(3)\n"
        docstring, future, rest = file.read_text(encoding="utf-8").partition("from __future__ import annotations\n")
        file.write_text(docstring + future + leave + rest, encoding="utf-8")
    return folder


def ask(here, model, *more):
    """Whether it was run, and what was said."""
    ran = here.parent / "ran"
    ran.unlink(missing_ok=True)
    done = call(*more, "mismatch", here / "pendulum.csv", "--simulator", here / model)
    assert done.code == FAILED
    return ran.exists(), done.err


def allow(here, model):
    call("mismatch", here / "pendulum.csv", "--simulator", here / model, "--allow")


def test_nothing_of_it_runs_before_and_the_refusal_names_what_would_run(here):
    ran, said = ask(here, "pendulum.yaml")
    assert not ran
    assert "it runs `pendulum.py`, which you have not allowed; read its files; if you trust them, give --allow" in said


def test_once_allowed_it_runs_until_a_file_of_it_changes(here):
    allow(here, "pendulum.yaml")
    assert ask(here, "pendulum.yaml")[0]
    (here / "notes.txt").write_text("changes nothing\n", encoding="utf-8")
    assert ask(here, "pendulum.yaml")[0]
    assert not ask(here, "tank.yaml")[0]
    for changed in ("beside.py", "pendulum.py", "pendulum.yaml"):
        with (here / changed).open("a", encoding="utf-8") as file:
            file.write("# changed\n")
        assert not ask(here, "pendulum.yaml")[0], changed
        allow(here, "pendulum.yaml")
        assert ask(here, "pendulum.yaml")[0], changed


def test_settings_of_ones_own_allow_it_and_those_of_the_folder_do_not(here, tmp_path, monkeypatch):
    key = re.search(r"put (\w{64}) into", ask(here, "pendulum.yaml")[1])[1]
    text = f"format: dbb-settings/1\nsimulators: [{key}]\n"
    own = tmp_path / "ci.yaml"
    own.write_text(text, encoding="utf-8")
    assert ask(here, "pendulum.yaml", "--settings", own)[0]
    (here / "dbbstation-settings.yaml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(here)
    assert not ask(here, "pendulum.yaml")[0]


def test_a_list_that_cannot_be_kept_is_said_and_hinders_nothing(here, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setattr(allowed, "allowed_file", lambda: tmp_path / "file" / "allowed.txt")
    done = call("mismatch", here / "pendulum.csv", "--simulator", here / "pendulum.yaml", "--allow")
    assert "the simulator is not noted as allowed" in done.err
    assert (tmp_path / "ran").exists()


def test_shipped_simulators_are_allowed():
    for name in KINDS:
        assert allowed.require_allowed(SIMULATORS / name, (), allow=False) == ""
