"""Files that the package ships: inside it when installed from a wheel, beside it in a checkout."""

from __future__ import annotations

from pathlib import Path

from dbbstation.errors import InputError, Problem


def checkout() -> Path | None:
    """Return the folder of the source that this package is part of; None where it was installed from a wheel."""
    root = Path(__file__).resolve().parents[2]
    return root if (root / "pyproject.toml").is_file() and (root / "studies").is_dir() else None


def shipped_folder(name: str) -> Path:
    """Return the folder `name` (for example `protocols`) with the files that the package ships.

    A wheel carries it inside the package; in a checkout, and in an editable install of one, it stands beside it.

    Raises:
        InputError: the installation has no such folder.
    """
    package = Path(__file__).resolve().parent.parent
    for folder in (package / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise InputError(
        [Problem(str(package / name), 0, 0, "this folder of the installation is missing", "install dbbstation again")]
    )
