"""Machines, plans and bar calibrations to choose from, in the working folder and the package."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import TYPE_CHECKING

from dbbstation.files.gateway import head_of
from dbbstation.files.shipped import shipped_folder

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


class CandidateFormat(StrEnum):
    """Formats to choose from; the value is the begin of their `format` key."""

    MACHINE = "dbb-machine/"
    PLAN = "dbb-plan/"
    BAR = "dbb-bar/"
    MODEL = "dbb-model/"


DEPTH = 2
"""Depth of folders below the working folder that are searched."""

_HEAD = 4096
"""Number of bytes at a file's begin that contain its format, behind the comments at its top."""

_SHIPPED = {
    CandidateFormat.MACHINE: ("fixtures", "machines/reference.yaml"),
    CandidateFormat.PLAN: ("protocols", "plans/*.yaml"),
}
"""Examples that come with the package."""


def candidates(kind: CandidateFormat, under: Path, *, shipped: bool = True) -> tuple[Path, ...]:
    """Return the files of a format, first those in a folder; copies in sessions are left out."""
    own = [path for path in _files(under, DEPTH) if _is(kind, path)]
    if not shipped or kind not in _SHIPPED:
        return tuple(own)
    folder, pattern = _SHIPPED[kind]
    of_package = [path for path in sorted(shipped_folder(folder).glob(pattern)) if path not in own]
    return (*own, *of_package)


def _files(folder: Path, depth: int) -> Iterator[Path]:
    try:
        inside = sorted(folder.iterdir())
    except OSError:
        return
    if any(path.name == "session.yaml" for path in inside):
        return
    yield from (path for path in inside if path.suffix in {".yaml", ".yml"} and path.is_file())
    if depth:
        for path in inside:
            if path.is_dir() and not path.name.startswith("."):
                yield from _files(path, depth - 1)


def _is(kind: CandidateFormat, path: Path) -> bool:
    try:
        head = head_of(path, _HEAD)
    except OSError:
        return False
    return re.search(rb"^format:\s*['\"]?" + re.escape(kind.encode()), head, re.MULTILINE) is not None
