"""Targets of paths, with links resolved, and their names."""

from __future__ import annotations

import os
from pathlib import Path


def real_path(path: Path) -> Path:
    """Return the absolute target of a path; of circular links, the link itself.

    `Path.resolve` raises `RuntimeError` there before Python 3.13.
    """
    return Path(os.path.realpath(path))


def unused_path(folder: Path, name: str, suffix: str = "") -> Path:
    """Return an unused path with this name, numbered if necessary."""
    numbered = (folder / f"{name if k == 1 else f'{name}-{k}'}{suffix}" for k in range(1, MOST_NUMBERED))
    return next(path for path in numbered if not path.exists())


MOST_NUMBERED = 10_000
"""Greatest number that is tried in a name."""


def name_of(path: Path) -> str:
    r"""Return the name of a path's target as text; a byte that is no UTF-8 shows as `\xfc`."""
    return text_of_name(real_path(path).name)


def text_of_name(name: str) -> str:
    """Return a name or path as text; see `name_of`."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")
