"""Write files completely or not at all: a temporary file beside the target is synced and renamed.

After a power cut the old or the new file exists, and perhaps a temporary file with `.new` in its name.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import re
import stat
import tempfile
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, BinaryIO

from dbbstation.errors import OutputError, unwritable
from dbbstation.files.inputs import open_book
from dbbstation.files.places import real_path, refuse_recorded
from dbbstation.system.handles import may_write, open_private
from dbbstation.system.replacing import remove, remove_tree, rename, replace, sync_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

_LOG = logging.getLogger(__name__)

_MARK = ".new"

_WITH_NAMES = re.compile(r"(session|events|station)(-\w+)?\.(yaml|log|json)")
"""Names of files that contain operators' names. Only their owner may read them; changed rights are kept."""


def write_text(path: Path, text: str, *, force: bool = False, rewrites: bool = False) -> None:
    """Write a text file, UTF-8 with LF; see `write_bytes`."""
    write_bytes(path, text.encode(), force=force, rewrites=rewrites)


def write_bytes(path: Path, data: bytes, *, force: bool = False, rewrites: bool = False) -> None:
    """Write a file.

    Args:
        rewrites: the file belongs to the program and was read to be changed.

    Raises:
        OutputError: the file exists without `force`, lies in a session, was read by this command, or cannot be written; the old
            file stays.
    """
    _refuse_unfit(path, force=force)
    if not rewrites:
        refuse_recorded(path)
        _refuse_input(path)
    with _replacing(path) as file:
        file.write(data)


@contextlib.contextmanager
def streamed(path: Path, *, force: bool = False) -> Iterator[BinaryIO]:
    """Yield a temporary file for writing piece by piece; at the end it replaces the target.

    Raises:
        OutputError: as `write_bytes`; the old file stays after any error.
    """
    refuse_existing(path, force=force)
    _refuse_input(path)
    with _replacing(path) as file:
        yield file


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[BinaryIO]:
    path = real_path(path)  # a link stays a link, what it leads to is replaced
    with told_of(path):
        temporary = _temporary(path)
        try:
            with _synced(temporary) as file:
                yield file
            replace(temporary, path)
        except BaseException:
            remove(temporary)
            raise
        sync_folder(path.parent)
    _LOG.info("wrote %s", path)


def write_folder(
    folder: Path,
    files: Mapping[str, str | bytes],
    *,
    force: bool = False,
    own: bool = False,
    read_only: Callable[[str], bool] = lambda _name: False,
) -> None:
    """Write several files into a folder, all or none; a missing folder is made.

    Args:
        files: content by path; a path that ends with a slash is an empty folder.
        own: the files are part of this session folder.

    Raises:
        OutputError: a file exists without `force`, lies in a session, or cannot be written; nothing has changed.
    """
    if not own:
        refuse_recorded(folder / "any")
    if not folder.exists():
        with told_of(folder):
            _make_parents(folder.parent)
            made = Path(tempfile.mkdtemp(prefix=f".{folder.name}", suffix=_MARK, dir=folder.parent))
            try:
                made.chmod(_usual_mode(0o777))
                _replace_all(made, files, read_only)
                rename(made, folder)
            except BaseException:
                remove_tree(made)
                raise
            sync_folder(folder.parent)
        _LOG.info("wrote %s with %d files", folder, len(files))
        return
    for name in files:
        if not name.endswith("/"):
            _refuse_overwriting(folder / name, force=force)
            if not own:
                _refuse_input(folder / name)
        if own and not real_path((folder / name).parent).is_relative_to(real_path(folder)):
            what = "a link in the session leads out of it, and nothing is written there"
            raise OutputError(what, where=str((folder / name).parent), remedy="put the folder itself there, not a link")
    with told_of(folder):
        _replace_all(folder, files, read_only)
    for name in files:
        _LOG.info("wrote %s", folder / name)


def refuse_existing(path: Path, *, force: bool) -> None:
    """Refuse an existing output or a missing folder before long work.

    Raises:
        OutputError: the path exists without `force`, is a folder, has no folder to go into, or lies in a session.
    """
    refuse_recorded(path)
    _refuse_unfit(path, force=force)


def _refuse_unfit(path: Path, *, force: bool) -> None:
    _refuse_overwriting(path, force=force)
    if not path.parent.is_dir():
        what = f"cannot be written: there is no folder {path.parent}"
        raise OutputError(what, where=str(path), remedy="make the folder, or name another")
    if not may_write(path.parent):
        raise unwritable(PermissionError(errno.EACCES, os.strerror(errno.EACCES)), path)


def refuse_outputs(paths: Iterable[Path | None], *, force: bool) -> None:
    """Refuse outputs of a command that cannot be written.

    Raises:
        OutputError: as `refuse_existing`, or two outputs have one name.
    """
    named: set[Path] = set()
    for path in paths:
        if path is None:
            continue
        refuse_existing(path, force=force)
        if real_path(path) in named:
            raise OutputError("two outputs have this name", where=str(path), remedy="name another file for one of them")
        named.add(real_path(path))


def _refuse_input(path: Path) -> None:
    if open_book().was_read(path):
        what = "this file was read just now: the result would take its place"
        raise OutputError(what, where=str(path), remedy="name another file")


def _refuse_overwriting(path: Path, *, force: bool) -> None:
    if path.is_dir():
        raise OutputError("this is a folder: give the name of a file", where=str(path), remedy="name a file")
    if path.is_symlink() and not path.exists():
        what = f"this is a link to {path.readlink()}, which is not there"
        raise OutputError(what, where=str(path), remedy="name the file itself")
    if path.exists() and not path.is_file():
        raise OutputError("this is a device or a pipe, not a file", where=str(path), remedy="name a file")
    if path.exists() and not force:
        raise OutputError("the file exists already", where=str(path), remedy="give --force to replace it")


def is_leftover(path: PurePath) -> bool:
    """Return whether a path is, or is inside, a temporary file or folder of an interrupted write."""
    return any(part.startswith(".") and part.endswith(_MARK) for part in path.parts)


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of interrupted writes below a folder that no other process writes into."""
    for left in sorted(folder.rglob(f".*{_MARK}")):
        if left.is_dir() and not left.is_symlink():
            remove_tree(left)
        elif left.is_file() and not left.is_symlink():
            remove(left)


def _make_parents(folder: Path) -> None:
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    for made in missing:
        sync_folder(made.parent)


def set_read_only(path: Path) -> None:
    """Make a file read-only, if the system can.

    Raises:
        OSError: it is not there.
    """
    with contextlib.suppress(PermissionError):  # on shares that belong to somebody else
        path.chmod(path.stat().st_mode & ~_WRITE)


_WRITE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


def _replace_all(folder: Path, files: Mapping[str, str | bytes], read_only: Callable[[str], bool]) -> None:
    written: list[tuple[Path, Path]] = []
    try:
        for name, content in files.items():
            path = folder / name
            (path if name.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
            if not name.endswith("/"):
                temporary = _temporary(path)
                written.append((temporary, path))
                with _synced(temporary) as file:
                    file.write(content.encode() if isinstance(content, str) else content)
                if read_only(name):
                    set_read_only(temporary)
        for temporary, path in written:
            replace(temporary, path)
    except BaseException:
        for temporary, _ in written:
            remove(temporary)
        raise
    for parent in {folder / parent for name in files for parent in PurePath(name).parents}:
        sync_folder(parent)


def _temporary(path: Path) -> Path:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=_MARK, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    # mkstemp makes files that only their owner can read.
    wanted = 0o600 if _WITH_NAMES.fullmatch(path.name) else 0o666
    temporary.chmod(path.stat().st_mode & 0o777 if path.exists() else _usual_mode(wanted))
    return temporary


def _usual_mode(wanted: int) -> int:
    mask = os.umask(0)
    os.umask(mask)
    return wanted & ~mask


@contextlib.contextmanager
def _synced(path: Path) -> Iterator[BinaryIO]:
    opener = open_private if _WITH_NAMES.fullmatch(path.name) else None
    with open(path, "wb", opener=opener) as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


@contextlib.contextmanager
def told_of(path: Path) -> Iterator[None]:
    """Turn the system's refusal of a write into an `OutputError`."""
    try:
        yield
    except OSError as error:
        raise unwritable(error, path) from error
