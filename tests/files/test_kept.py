"""The index of what was worked out: begun anew whenever it is in doubt, never in the way."""

from __future__ import annotations

import sqlite3
from concurrent.futures import ThreadPoolExecutor

import pytest

from dbbstation.files import kept as module
from dbbstation.files.kept import Kept, NotedAnchor, index_file
from dbbstation.system import mounts as of_mounts

STAMP = "a stamp"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "sessions").mkdir()
    return tmp_path / "sessions"


def keep(folder, name="a", text="text", stamp=STAMP):
    with Kept(folder) as index:
        index.keep(name, stamp, "hash of " + name, text)
    return index


def known(folder, name="a", **how):
    with Kept(folder, **how) as index:
        return index.of(name, STAMP)


def test_what_is_kept_is_there_the_next_time(folder, tmp_path):
    keep(folder)
    assert known(folder) == "text"
    assert index_file(folder).is_relative_to(tmp_path / "cache")
    assert list(folder.iterdir()) == []
    assert [path.suffix for path in index_file(folder).parent.iterdir()] == [".sqlite"]


def test_a_file_that_changed_is_not_known_but_its_content_may_be(folder):
    keep(folder)
    with Kept(folder) as index:
        assert index.of("a", "another") is None
        assert index.of_content("hash of a") == "text"
        assert index.of_content("hash of b") is None


def test_files_that_are_gone_are_forgotten(folder):
    keep(folder, "a")
    keep(folder, "b")
    with Kept(folder) as index:
        index.drop_others(["b"])
    assert (known(folder, "a"), known(folder, "b")) == (None, "text")


@pytest.mark.parametrize("content", [b"", b"not a data base", b"SQLite format 3\x00" + b"\xff" * 5000])
def test_a_damaged_index_is_begun_anew(folder, content):
    keep(folder)
    index_file(folder).write_bytes(content)
    assert known(folder) is None
    keep(folder, text="again")
    assert known(folder) == "again"


def test_an_index_cut_short_is_begun_anew(folder):
    with Kept(folder) as index:
        for number in range(100):
            index.keep(f"name {number}", STAMP, str(number), "x" * 2000)
    data = index_file(folder).read_bytes()
    index_file(folder).write_bytes(data[: len(data) // 2])
    assert known(folder, "name 99") is None
    keep(folder)
    assert known(folder) == "text"


def test_an_index_of_another_version_is_begun_anew(folder, monkeypatch):
    keep(folder)
    monkeypatch.setattr(module, "key_of", lambda _request: "another")
    assert known(folder) is None


def test_it_can_be_begun_anew_on_purpose(folder):
    keep(folder)
    assert known(folder, begin_anew=True) is None


def test_there_is_no_write_ahead_log(folder):
    keep(folder)
    with sqlite3.connect(index_file(folder)) as base:
        assert base.execute("PRAGMA journal_mode").fetchone() == ("delete",)
    base.close()


def test_what_is_kept_outlasts_an_error(folder):
    def interrupted():
        with Kept(folder) as index:
            index.keep("a", STAMP, "hash", "text")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert known(folder) == "text"


def test_several_at_once_are_harmless(folder):
    with ThreadPoolExecutor(8) as pool:
        problems = [one.problem for one in pool.map(lambda k: keep(folder, f"n{k % 4}"), range(40))]
    assert problems == [""] * 40
    assert [known(folder, f"n{k}") for k in range(4)] == ["text"] * 4


def test_a_locked_index_is_not_waited_for_and_not_removed(folder, monkeypatch):
    monkeypatch.setattr(module, "_PATIENCE_S", 0.05)
    keep(folder)
    base = sqlite3.connect(index_file(folder), isolation_level=None)
    base.execute("BEGIN EXCLUSIVE")
    with Kept(folder) as index:
        assert "locked" in index.problem
        index.keep("b", STAMP, "hash", "still usable")
        assert index.of("b", STAMP) == "still usable"
    base.execute("ROLLBACK")
    base.close()
    assert known(folder) == "text"


def test_a_cache_folder_among_the_sessions_is_not_used(folder, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "w01"))
    index = keep(folder)
    assert "lies in the folder of the sessions" in index.problem
    assert list(folder.iterdir()) == []


def test_a_cache_folder_on_a_share_is_not_used(folder, monkeypatch, tmp_path):
    mounts = tmp_path / "mounts"
    cache = str(tmp_path / "cache").replace(" ", "\\040")
    mounts.write_text(f"/dev/sda1 / ext4 rw 0 0\nserver:/home {cache} nfs4 rw 0 0\n", encoding="utf-8")
    monkeypatch.setattr(of_mounts, "_MOUNTS", mounts)
    index = keep(folder)
    assert "on a share (nfs4)" in index.problem
    assert not (tmp_path / "cache").exists()


def test_a_cache_folder_that_cannot_be_made_is_told(folder, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert "nothing is kept" in keep(folder).problem


def test_an_anchor_outlasts_an_index_that_is_begun_anew_on_purpose(folder, monkeypatch):
    keep(folder)
    with Kept(folder) as index:
        index.note("a", NotedAnchor("ab" * 32, "2026-11-23T08:00:00+00:00"))
    with Kept(folder, begin_anew=True) as index:
        assert index.of("a", STAMP) is None
        assert index.noted("a") == NotedAnchor("ab" * 32, "2026-11-23T08:00:00+00:00")
    monkeypatch.setattr(module, "key_of", lambda _request: "another")
    with Kept(folder) as index:
        assert index.noted("a").anchor == "ab" * 32
