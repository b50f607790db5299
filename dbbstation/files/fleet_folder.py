"""The folder of a fleet's results, one file per key."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from dbbstation.errors import OutputError
from dbbstation.files.atomic import is_leftover, remove_leftovers, write_bytes, write_text
from dbbstation.files.gateway import content_of
from dbbstation.files.recordings.lock import LOCK_FILE, SessionLock
from dbbstation.system.handles import Closing

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

FORMAT = "dbb-fleet-result/1"

_MARK = "fleet.json"
"""File that marks a folder of results."""

_SHOWN = 16
"""Number of digits of a key in file names."""

_LONGEST = 60
"""Number of characters of a session's name in file names."""


class FleetFolder(Closing):
    """Results of one task in a folder.

    Raises:
        OutputError: the folder contains other files, or cannot be written.
    """

    def __init__(self, folder: Path, task: str) -> None:
        mark = folder / _MARK
        if folder.exists() and not mark.is_file() and (not folder.is_dir() or not all(map(_begun, folder.iterdir()))):
            what = "this is no folder of fleet results, and something lies in it"
            raise OutputError(what, where=str(folder), remedy="name another with --out, or an empty one")
        self.folder = folder
        self.table = folder / f"{task}.csv"
        self.page = folder / f"{task}.html"
        self._results = folder / task
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if not mark.is_file():
                write_text(mark, json.dumps({"format": "dbb-fleet/1"}) + "\n")
            self._results.mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot be made: {error.strerror}", where=str(self._results)) from error
        # Another process that works in the folder has temporary files there: only who is alone removes any.
        self._lock: SessionLock | None = None
        with suppress(OutputError):
            self._lock = SessionLock(folder)
            remove_leftovers(folder)

    def close(self) -> None:
        """Unlock the folder for other processes."""
        if self._lock is not None:
            self._lock.close()

    def known(self, name: str, key: str) -> dict[str, object] | None:
        """Return the stored result of a key, or None."""
        path = self._file(name, key)
        try:
            data = json.loads(content_of(path))
        except (OSError, ValueError):
            return None
        if not isinstance(data, dict) or (data.get("format"), data.get("key")) != (FORMAT, key):
            return None
        return data if all((self.folder / file).is_file() for file in data.get("files", ())) else None

    def keep(self, name: str, key: str, data: Mapping[str, Any], files: Mapping[str, bytes]) -> dict[str, object]:
        """Store a result and return it as `known` does.

        Raises:
            OutputError: it cannot be written.
        """
        path = self._file(name, key)
        for ending, content in files.items():
            write_bytes(path.with_suffix(ending), content, force=True)
        places = [path.with_suffix(ending).relative_to(self.folder).as_posix() for ending in files]
        whole = {"format": FORMAT, "key": key, **data, "files": places}
        write_text(path, json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n", force=True)
        return whole

    def file_of(self, name: str, key: str) -> str:
        """Return a result's path within the folder."""
        return self._file(name, key).relative_to(self.folder).as_posix()

    def _file(self, name: str, key: str) -> Path:
        plain = re.sub(r"[^A-Za-z0-9_-]+", "-", name)[-_LONGEST:].strip("-") or "session"
        return self._results / f"{plain}-{key[:_SHOWN]}.json"


def _begun(path: Path) -> bool:
    return path.name == LOCK_FILE or is_leftover(path)
