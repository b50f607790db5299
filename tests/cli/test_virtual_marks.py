"""Everything that comes from a virtual session says so."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import pytest
import yaml

from dbbstation.files.formats.model import read_model
from dbbstation.files.inputs import input_book, open_book
from dbbstation.files.places import shipped_folder
from dbbstation.files.provenance import Provenance
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.tasks.session_figures import session_figures
from tests.cli.conftest import call

if TYPE_CHECKING:
    from pathlib import Path


def test_what_comes_from_a_virtual_session_says_so(tmp_path: Path) -> None:
    session = shipped_folder("fixtures") / "sessions" / "virtual"
    told = call("circles", session)
    assert "VIRTUAL MACHINE: virtual" in told.err
    assert json.loads(call("circles", session, "--json").out)["provenance"]["virtual"] == ["virtual"]
    assert json.loads(call("check", session, "--json").out)["files"][0]["virtual"] is True
    assert json.loads(call("session", "list", session, "--json").out)["virtual"] is True
    figure = tmp_path / "circle.svg"
    assert call("circles", session, "--figure", figure).code == 0
    assert figure.read_text("utf-8").count("VIRTUAL MACHINE") >= 1
    # A model remembers what it was made of, and so does what is made with it.
    data = yaml.safe_load((shipped_folder("fixtures") / "models" / "small.yaml").read_text("utf-8"))
    data["provenance"] = {"program": "p", "command": "c", "inputs": {}, "virtual": ["virtual"]}
    model = tmp_path / "model.yaml"
    model.write_text(yaml.safe_dump(data), "utf-8")
    with input_book():
        read_model(model)
        assert tuple(open_book().virtual) == ("model.yaml",)
        comments = Provenance("p", "c", {}, tuple(open_book().virtual)).comments({})
    assert next(iter(comments.items())) == ("VIRTUAL MACHINE", "computed from model.yaml")
    # Its history is one of its own.
    assert session_figures(session).machine == "virtual PM600-0007"


@pytest.mark.slow
def test_every_command_on_a_virtual_session_marks_what_it_makes(tmp_path: Path) -> None:
    fixtures, here = shipped_folder("fixtures"), tmp_path
    plan = shipped_folder("protocols") / "plans" / "table2.yaml"
    machine = fixtures / "machines" / "reference.yaml"
    model, session = here / "model.yaml", here / "sim"
    for made, tests, samples in ((session, "a,b,c", 60), (here / "again", "a", 72)):
        told = call(
            "simulate", "--model", fixtures / "models" / "small.yaml", plan, "--tests", tests, "--samples", samples,
            "--out", made,
        )  # fmt: skip
        assert told.code == 0, told.err
    shutil.copytree(fixtures / "sessions" / "small", here / "real")
    shutil.copytree(fixtures / "sessions" / "virtual", here / "other")
    commands = (
        ("check", session),
        ("session", "list", session),
        ("circles", session, "--table", here / "circles.csv"),
        ("export", session, "--out", here / "samples.csv"),
        ("calibrate", session, "--sources", "strut-reference-length", "--out", model),
        ("evaluate", session, "--model", model),
        ("compare", session, here / "again"),
        ("history", here, "--page", here / "history.html"),
        ("report", session, "--page", here / "report.html"),
        ("program", "--plan", plan, "--tests", "a", "--machine", machine, "--model", model, "--out", here / "programs"),
        ("simulate", "--model", model, plan, "--tests", "a", "--samples", 60, "--out", here / "predicted"),
        *(("circles", session, "--figure", here / f"circles.{ending}") for ending in ("svg", "png", "pdf")),
    )
    for words in commands:
        done = call(*words)
        assert done.code == 0, (words, done.err)
        assert "VIRTUAL MACHINE" in done.err, words
    assert "sim" in yaml.safe_load(model.read_text("utf-8"))["provenance"]["virtual"]
    for path in (*(here / "programs").iterdir(), here / "report.html", here / "circles.svg"):
        assert "VIRTUAL MACHINE" in path.read_text("utf-8"), path
    for path in here.glob("*.provenance.json"):
        assert json.loads(path.read_text("utf-8"))["virtual"] == ["sim"], path
    assert b"VIRTUAL MACHINE" in (here / "circles.png").read_bytes()
    assert read_session(here / "predicted").virtual
    # Charts of virtual and real machines of one number are apart.
    machines = json.loads(call("history", here, "--json").out)["machines"]
    names = [one["machine"] for one in machines]
    assert len(names) == len(set(names))
    assert any(name.startswith("virtual ") for name in names)
    assert not all(name.startswith("virtual ") for name in names)


def test_a_virtual_session_beside_a_real_one_does_not_mark_it(tmp_path: Path) -> None:
    for name in ("small", "virtual"):
        shutil.copytree(shipped_folder("fixtures") / "sessions" / name, tmp_path / name)
    with input_book():
        assert not former_sessions(read_session(tmp_path / "small"), tmp_path)
        assert tuple(open_book().virtual) == ()
