"""File systems: free space and kind."""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path

_MOUNTS = Path("/proc/self/mounts")


def free_bytes(path: Path) -> int | None:
    """Return the free space for a file or folder; None if unknown."""
    for folder in (path, *path.absolute().parents):
        with suppress(OSError):
            return shutil.disk_usage(folder).free
    return None


def file_system(path: Path) -> str:
    """Return the kind of file system of an absolute path, such as `nfs4`; empty if unknown."""
    if str(path).startswith("\\\\"):  # Windows: a folder of another computer
        return "cifs"
    try:
        lines = _MOUNTS.read_text("utf-8", "replace").splitlines()
    except OSError:
        return ""
    mounts = [(Path(words[1].replace("\\040", " ")), words[2]) for words in map(str.split, lines) if len(words) > 2]  # noqa: PLR2004 - device, place, kind
    over = [(len(place.parts), kind) for place, kind in mounts if path.is_relative_to(place)]
    return max(over, default=(0, ""))[1]
