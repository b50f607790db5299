"""Targets of paths, with links resolved, their names, and the folders of the package."""

from __future__ import annotations

import os
from pathlib import Path

from dbbstation.errors import InputError


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


def shipped_folder(name: str) -> Path:
    """Return a shipped folder, such as `protocols`.

    Raises:
        InputError: the installation lacks it.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise InputError.of(package / name, "this folder is missing in the installation", "install dbbstation again")


def package_text(name: str) -> str:
    """Return a text file of the package, by its path in the package."""
    return (Path(__file__).resolve().parent.parent / name).read_text(encoding="utf-8")
