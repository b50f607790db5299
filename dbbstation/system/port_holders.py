"""Find programs that have a port open, if the system lists them."""

from __future__ import annotations

import os
from pathlib import Path

_PROC = Path("/proc")


def holders(port: str, proc: Path = _PROC) -> list[str]:
    """Return name and number of every other process with this port open, such as `minicom (process 4711)`.

    Linux lists processes of the same user, and all processes for root. On other systems the list is empty.
    """
    target = os.path.realpath(port)
    others = [one for one in _entries(proc) if one.name.isdecimal() and int(one.name) != os.getpid()]
    holding = [one for one in others if any(_leads_to(link, target) for link in _entries(one / "fd"))]
    return [f"{_name(one)} (process {one.name})" for one in sorted(holding, key=lambda one: int(one.name))]


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:  # it has ended, or belongs to somebody else
        return []


def _leads_to(link: Path, target: str) -> bool:
    try:
        return str(link.readlink()) == target
    except OSError:
        return False


def _name(process: Path) -> str:
    try:
        return (process / "comm").read_text(encoding="utf-8", errors="replace").strip() or "a program"
    except OSError:
        return "a program"
