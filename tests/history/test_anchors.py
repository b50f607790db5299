"""What a history noted of the seals of its sessions: a seal that was taken out, or exchanged, shows every time."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from dbbstation.files.places import shipped_folder
from dbbstation.files.recordings.event_log import EVENTS_FILE
from dbbstation.files.recordings.sealing import seal_session
from dbbstation.files.recordings.session_writer import SessionWriter
from tests.cli.conftest import call

LOGGED = shipped_folder("fixtures") / "sessions" / "logged"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    shutil.copytree(LOGGED, tmp_path / "h" / "one")
    return tmp_path / "h"


def seals(folder: Path, *more: str) -> list[str]:
    return [note for note in call("history", folder, "--json", *more).data["notes"] if "seal" in note]


def without_seal(session: Path) -> None:
    (session / EVENTS_FILE).unlink()
    text = (session / "session.yaml").read_text(encoding="utf-8")
    bare = re.sub(r", chain_sha256: [0-9a-f]{64}", "", re.sub(r"seal:\n(  .*\n)+", "", text))
    (session / "session.yaml").write_text(re.sub("    chain_sha256: .*\n", "", bare), encoding="utf-8")


def test_a_seal_that_was_taken_out_or_made_anew_shows_every_time(folder: Path) -> None:
    assert seals(folder) == []
    with SessionWriter.open(folder / "one") as writer:
        writer.judge(writer.runs[0], accepted=False, reason="chip")
        anchor = writer.session.seal.log.sha256
    assert seals(folder) == []
    without_seal(folder / "one")
    for more in ((), (), ("--anew",)):
        (note,) = seals(folder, *more)
        assert note.startswith(f"one carries no seal, one ended with {anchor[:16]} on ")
    seal_session(folder / "one")
    (note,) = seals(folder)
    assert "one carries another seal" in note
    assert f"one ended with {anchor[:16]}" in note
