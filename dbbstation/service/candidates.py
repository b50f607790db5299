"""Files to choose: machines, plans and bar calibrations of working folder and package."""

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
    """Formats to choose from, by the begin of their `format` key."""

    MACHINE = "dbb-machine/"
    PLAN = "dbb-plan/"
    BAR = "dbb-bar/"
    MODEL = "dbb-model/"


DEPTH = 2
"""Folders below the working folder that are looked into."""

_HEAD = 4096
"""Bytes of a file within which its format is stated: behind the comments at its top."""

_SHIPPED = {
    CandidateFormat.MACHINE: ("fixtures", "machines/reference.yaml"),
    CandidateFormat.PLAN: ("protocols", "plans/*.yaml"),
}
"""Examples that come with the package."""


def candidates(kind: CandidateFormat, under: Path, *, shipped: bool = True) -> tuple[Path, ...]:
    """Return files of a format, those under a folder first, without session copies."""
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
