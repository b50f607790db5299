"""An index of computed results in the user's cache folder, never the only copy.

SQLite runs without a write-ahead log and never on a network share.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sqlite3
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dbbstation.files.gateway import sha256_hex
from dbbstation.files.keys import key_of
from dbbstation.files.places import real_path
from dbbstation.system.handles import Closing
from dbbstation.system.mounts import file_system

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

_LOG = logging.getLogger(__name__)

_PATIENCE_S = 5.0
"""Longest wait for another writing process [s]; after this time the result is not stored."""

SHARES = frozenset(
    {"9p", "afs", "ceph", "cifs", "davfs", "fuse.davfs2", "fuse.glusterfs", "fuse.rclone", "fuse.s3fs", "fuse.sshfs"}
    | {"glusterfs", "ncpfs", "nfs", "nfs4", "smb3", "smbfs"}
)
"""Network file systems, on which SQLite's locks are unreliable."""


def stamp_of(path: Path, *others: Path) -> str:
    """Return evidence that one or several files are unchanged, from their names, times and sizes, without reading them.

    Raises:
        OSError: one is missing.
    """
    stats = [(str(one), one.stat()) for one in (path, *others)]
    return sha256_hex(repr([(name, one.st_mtime_ns, one.st_size) for name, one in stats]))


@dataclass(frozen=True)
class NotedAnchor:
    """A noted anchor."""

    anchor: str
    at: str


class CacheFile(Closing):
    """An SQLite file in the user's cache folder; a damaged one is begun anew.

    Attributes:
        problem: why nothing can be kept; empty if possible.
    """

    nothing = "nothing is kept for the next time"

    def __init__(self, file: Path, problem: str) -> None:
        self.problem = ""
        self._file = file
        self._base: sqlite3.Connection | None = None
        if problem:
            self._give_up(problem)
        else:
            self._open()

    def close(self) -> None:
        """Close the file; everything is already written."""
        if self._base is not None:
            self._base.close()
            self._base = None

    def _begin(self, base: sqlite3.Connection) -> None:
        """Prepare and read an opened file."""
        raise NotImplementedError

    def _open(self) -> None:
        for attempt in range(2):
            try:
                self._file.parent.mkdir(parents=True, exist_ok=True)
                self._base = sqlite3.connect(self._file, timeout=_PATIENCE_S, isolation_level=None)
                self._begin(self._base)
            except (sqlite3.OperationalError, OSError) as error:  # locked, no room, no permission: not for us to remove
                self._give_up(str(error))
            except (sqlite3.DatabaseError, TypeError, ValueError) as error:
                _LOG.info("the file %s is damaged and is begun anew: %s", self._file, error)
                self.close()
                self._forget()
                if attempt:
                    self._give_up(str(error))
            if self._base is not None or self.problem:
                return

    def _forget(self) -> None:
        for path in (self._file, self._file.with_name(self._file.name + "-journal")):
            with contextlib.suppress(OSError):
                path.unlink()

    def _write(self, command: str, rows: Sequence[tuple[object, ...]]) -> None:
        if self._base is None or not rows:
            return
        try:
            self._base.execute("BEGIN IMMEDIATE")
            self._base.executemany(command, rows)
            self._base.execute("COMMIT")
        except sqlite3.Error as error:
            self._give_up(str(error))

    def _give_up(self, why: str) -> None:
        self.close()
        self.problem = f"{self.nothing} ({self._file}): {why}"
        _LOG.info("%s", self.problem)


class Kept(CacheFile):
    """Stored results of one folder's files, each written at once.

    Args:
        begin_anew: discard all but noted anchors.
    """

    def __init__(self, folder: Path, *, begin_anew: bool = False) -> None:
        self._rows: dict[str, tuple[str, str]] = {}
        self._noted: dict[str, NotedAnchor] = {}
        self._by_hash: dict[str, str] = {}
        self._begin_anew = begin_anew
        file = index_file(folder)
        super().__init__(file, _unfit(file, folder))

    def of(self, name: str, stamp: str) -> str | None:
        """Return the stored result of an unchanged file, or None."""
        known, text = self._rows.get(name, ("", ""))
        return text if known == stamp else None

    def of_content(self, sha256: str) -> str | None:
        """Return the stored result of a file with this content, or None."""
        return self._by_hash.get(sha256)

    def keep(self, name: str, stamp: str, sha256: str, text: str) -> None:
        """Store a file's result."""
        self._rows[name] = stamp, text
        self._by_hash[sha256] = text
        self._write("INSERT OR REPLACE INTO kept VALUES (?, ?, ?, ?)", [(name, stamp, sha256, text)])

    def drop_others(self, names: Iterable[str]) -> None:
        """Delete the results of missing files."""
        gone = self._rows.keys() - set(names)
        for name in gone:
            del self._rows[name]
        self._write("DELETE FROM kept WHERE name = ?", [(name,) for name in sorted(gone)])

    def noted(self, name: str) -> NotedAnchor | None:
        """Return the noted anchor of a file, or None."""
        return self._noted.get(name)

    def note(self, name: str, noted: NotedAnchor) -> None:
        """Note the anchor of a file; it survives changes and a new index."""
        self._noted[name] = noted
        self._write("INSERT OR REPLACE INTO noted VALUES (?, ?, ?)", [(name, noted.anchor, noted.at)])

    def _begin(self, base: sqlite3.Connection) -> None:
        base.execute("PRAGMA journal_mode = DELETE")
        base.execute("BEGIN IMMEDIATE")
        base.execute("CREATE TABLE IF NOT EXISTS version (text TEXT)")
        program = key_of({"task": "index"})
        known = [text for (text,) in base.execute("SELECT text FROM version")]
        if known != [program] or self._begin_anew:
            base.execute("DROP TABLE IF EXISTS kept")
            base.execute("DELETE FROM version")
            base.execute("INSERT INTO version VALUES (?)", (program,))
        base.execute("CREATE TABLE IF NOT EXISTS kept (name TEXT PRIMARY KEY, stamp TEXT, sha256 TEXT, text TEXT)")
        base.execute("CREATE TABLE IF NOT EXISTS noted (name TEXT PRIMARY KEY, anchor TEXT, at TEXT)")
        base.execute("COMMIT")
        for name, stamp, digest, text in base.execute("SELECT name, stamp, sha256, text FROM kept"):
            self._rows[str(name)] = str(stamp), str(text)
            self._by_hash[str(digest)] = str(text)
        noted = base.execute("SELECT name, anchor, at FROM noted").fetchall()
        self._noted = {str(name): NotedAnchor(str(anchor), str(at)) for name, anchor, at in noted}


def index_file(folder: Path) -> Path:
    """Return the index file of a folder: in the cache, under a hash of its path."""
    import platformdirs  # noqa: PLC0415 - only a history looks for it

    digest = sha256_hex(os.fsencode(real_path(folder)))[:24]
    return platformdirs.user_cache_path("dbbstation", appauthor=False) / "history" / f"{digest}.sqlite"


def _unfit(file: Path, folder: Path) -> str:
    if real_path(file).is_relative_to(real_path(folder)):
        return "the cache folder lies in the folder of the sessions; set XDG_CACHE_HOME to another"
    return folder_problem(file)


def folder_problem(file: Path) -> str:
    """Return why a file cannot be an index; empty if it can."""
    kind = file_system(real_path(file))
    return f"the cache folder lies on a share ({kind}); set XDG_CACHE_HOME to a local one" if kind in SHARES else ""
