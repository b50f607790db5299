"""File systems: free space, kind, and names that every system accepts."""

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


DEVICES = frozenset({"con", "prn", "aux", "nul", *(f"{kind}{n}" for kind in ("com", "lpt") for n in range(1, 10))})
"""Names that Windows reserves before the first point of a file name, in any case (Microsoft, "Naming Files, Paths, and
Namespaces")."""


def is_device(name: str) -> bool:
    """Return whether Windows treats a name as a device."""
    return name.partition(".")[0].lower() in DEVICES
