"""Files are written whole or not at all, and never over others unasked."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO

import pytest

from dbbstation.errors import OutputError
from dbbstation.files import atomic
from dbbstation.files.atomic import refuse_existing, write_bytes, write_folder, write_text


def listing(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def test_a_new_file(tmp_path: Path) -> None:
    write_text(tmp_path / "a.yaml", "größe: 1\n")
    assert (tmp_path / "a.yaml").read_bytes() == "größe: 1\n".encode()
    assert listing(tmp_path) == ["a.yaml"]
    mask = os.umask(0)
    os.umask(mask)
    assert (tmp_path / "a.yaml").stat().st_mode & 0o777 == 0o666 & ~mask


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("old")
    with pytest.raises(OutputError, match=r"a\.yaml: the file exists already; give --force to replace it"):
        write_text(path, "new")
    assert path.read_text() == "old"
    path.chmod(0o640)
    write_text(path, "new", force=True)
    assert path.read_text() == "new"
    assert path.stat().st_mode & 0o777 == 0o640
    with pytest.raises(OutputError, match="this is a folder"):
        write_text(tmp_path, "new", force=True)


def test_a_folder_that_is_missing_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"none/a: cannot be written: there is no folder"):
        refuse_existing(tmp_path / "none" / "a", force=True)  # at once, before the work that would be lost
    with pytest.raises(OutputError, match=r"none/a: cannot be written: there is no folder .*none; make the folder"):
        write_bytes(tmp_path / "none" / "a", b"")


@pytest.mark.parametrize("step", ["_synced", "replace"])
def test_a_failure_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text("old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic if step == "_synced" else Path, step, fail)
    with pytest.raises(OutputError, match="no space left on device"):
        write_text(path, "new", force=True)
    assert listing(tmp_path) == ["a.yaml"]
    assert path.read_text() == "old"


def test_an_interrupt_leaves_the_old_file_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(atomic, "_synced", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_text(tmp_path / "a.yaml", "new")
    assert listing(tmp_path) == []


def test_the_data_is_on_disk_before_the_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    fsync, replace = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda handle: (order.append("sync"), fsync(handle)))
    monkeypatch.setattr(Path, "replace", lambda self, to: (order.append("rename"), replace(self, to)))
    write_text(tmp_path / "a", "x")
    assert order == ["sync", "rename", "sync"]


def test_a_new_folder_appears_whole(tmp_path: Path) -> None:
    write_folder(tmp_path / "deep" / "session", {"session.yaml": "a", "runs/": "", "programs/a.ngc": b"G1"})
    expected = ["deep", "deep/session", *(f"deep/session/{name}" for name in ("programs", "programs/a.ngc", "runs"))]
    assert listing(tmp_path) == [*expected, "deep/session/session.yaml"]
    assert (tmp_path / "deep" / "session" / "programs" / "a.ngc").read_bytes() == b"G1"


@pytest.mark.parametrize("there", [False, True])
def test_of_a_folder_all_files_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, there: bool) -> None:
    folder = tmp_path / "programs"
    if there:
        folder.mkdir()
        (folder / "a.ngc").write_text("old")
    write = atomic._synced
    count = [0]

    def fails_at_third(path: Path) -> AbstractContextManager[BinaryIO]:
        count[0] += 1
        if count[0] == 3:
            raise OSError(28, "No space left on device")
        return write(path)

    monkeypatch.setattr(atomic, "_synced", fails_at_third)
    before = listing(tmp_path)
    with pytest.raises(OutputError, match="no space left"):
        write_folder(folder, {f"{name}.ngc": name for name in "abcd"}, force=True)
    assert listing(tmp_path) == before
    if there:
        assert (folder / "a.ngc").read_text() == "old"


def test_one_file_that_exists_refuses_all(tmp_path: Path) -> None:
    (tmp_path / "b.ngc").write_text("old")
    with pytest.raises(OutputError, match=r"b\.ngc: the file exists already"):
        write_folder(tmp_path, {"a.ngc": "a", "b.ngc": "b"})
    assert listing(tmp_path) == ["b.ngc"]
    write_folder(tmp_path, {"a.ngc": "a", "b.ngc": "b"}, force=True)
    assert (tmp_path / "b.ngc").read_text() == "b"


def test_a_link_is_followed_and_a_dangling_one_refused(tmp_path):
    target, link, dangling = tmp_path / "model.yaml", tmp_path / "link.yaml", tmp_path / "gone.yaml"
    target.write_text("old", encoding="utf-8")
    link.symlink_to(target)
    dangling.symlink_to(tmp_path / "nowhere.yaml")
    write_text(link, "new", force=True)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == "new"
    with pytest.raises(OutputError, match=r"a link to .*nowhere\.yaml, which is not there"):
        write_text(dangling, "new", force=True)
    assert dangling.is_symlink()


def test_a_pipe_is_never_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OutputError, match="a device or a pipe"):
        write_text(pipe, "new", force=True)
    assert pipe.is_fifo()


@pytest.mark.skipif(os.name == "nt", reason="Windows has other rights")
def test_what_holds_operators_names_is_for_its_owner_until_the_owner_says_otherwise(tmp_path):
    write_folder(tmp_path / "s", {"session.yaml": "operator: a", "runs/a.csv": "", "events.log": ""})
    folder, mask = tmp_path / "s", os.umask(0)
    os.umask(mask)
    assert {name: (folder / name).stat().st_mode & 0o777 for name in ("session.yaml", "events.log", "runs/a.csv")} == {
        "session.yaml": 0o600,
        "events.log": 0o600,
        "runs/a.csv": 0o666 & ~mask,
    }
    write_folder(folder, {"sealed/session-0f.yaml": "operator: a"}, own=True)
    assert (folder / "sealed" / "session-0f.yaml").stat().st_mode & 0o777 == 0o600
    (folder / "session.yaml").chmod(0o640)
    write_text(folder / "session.yaml", "operator: b", force=True, rewrites=True)
    assert (folder / "session.yaml").stat().st_mode & 0o777 == 0o640
