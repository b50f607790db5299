"""Everything that comes from a virtual session says so."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import yaml

from dbbstation.files.formats.model import read_model
from dbbstation.files.inputs import input_book, virtual_so_far
from dbbstation.files.provenance import Provenance
from dbbstation.files.recordings.former import former_sessions
from dbbstation.files.recordings.session import read_session
from dbbstation.files.shipped import shipped_folder
from dbbstation.tasks.session_figures import session_figures
from tests.cli.conftest import call

if TYPE_CHECKING:
    from pathlib import Path


def test_what_comes_from_a_virtual_session_says_so(tmp_path: Path) -> None:
    session = shipped_folder("fixtures") / "sessions" / "virtual"
    told = call("circles", session)
    assert "VIRTUAL MACHINE: virtual" in told.err
    assert json.loads(call("circles", session, "--json").out)["provenance"]["virtual"] == ["virtual"]
    figure = tmp_path / "circle.svg"
    assert call("plot", session, "--out", figure).code == 0
    assert figure.read_text("utf-8").count("VIRTUAL MACHINE") >= 1
    # A model remembers what it was made of, and so does what is made with it.
    data = yaml.safe_load((shipped_folder("fixtures") / "models" / "small.yaml").read_text("utf-8"))
    data["provenance"] = {"program": "p", "command": "c", "inputs": {}, "virtual": ["virtual"]}
    model = tmp_path / "model.yaml"
    model.write_text(yaml.safe_dump(data), "utf-8")
    with input_book():
        read_model(model)
        assert virtual_so_far() == ("model.yaml",)
        comments = Provenance("p", "c", {}, virtual_so_far()).comments({})
    assert next(iter(comments.items())) == ("VIRTUAL MACHINE", "computed from model.yaml")
    # Its history is one of its own.
    assert session_figures(session).machine == "virtual PM600-0007"


def test_a_virtual_session_beside_a_real_one_does_not_mark_it(tmp_path: Path) -> None:
    for name in ("small", "virtual"):
        shutil.copytree(shipped_folder("fixtures") / "sessions" / name, tmp_path / name)
    with input_book():
        assert not former_sessions(read_session(tmp_path / "small"), tmp_path)
        assert virtual_so_far() == ()
