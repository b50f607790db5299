"""Find files shipped with the package: inside a wheel, or beside the package in a checkout."""

from __future__ import annotations

from pathlib import Path

from dbbstation.errors import InputError


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
