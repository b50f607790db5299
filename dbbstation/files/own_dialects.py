"""Find an NC dialect by name or in a user's Python file, and try it before use."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dbbstation.errors import Problem, refuse
from dbbstation.nc.dialect import Dialect
from dbbstation.nc.registry import dialect_named

if TYPE_CHECKING:
    from dbbstation.catalogue import FoundClass

CONTRACT = "see `A new dialect` in docs/nc.md"

DECLARED = ("name", "extension", "what")
"""Texts that a dialect must declare."""


def dialect_given(name_or_file: str) -> Dialect:
    """Return a dialect.

    Raises:
        StationError: nothing has this name.
        InputError: the file is missing, not Python, has not exactly one dialect, or fails its trial.
    """
    if not name_or_file.endswith(".py"):
        return dialect_named(name_or_file)
    from dbbstation.files.own_classes import classes_in_files  # noqa: PLC0415 - most dialects are the package's

    faults: list[Problem] = []
    found = classes_in_files([Path(name_or_file)], Dialect, CONTRACT, faults)  # never made
    if len(found) > 1:
        names = ", ".join(one.kind.__name__ for one in found)
        faults.append(Problem.of(name_or_file, f"there are several dialects in it: {names}", "leave one"))
    refuse(faults)
    return _tried(found[0])


def _tried(found: FoundClass[Dialect]) -> Dialect:
    from dbbstation.nc.trial import faults_of  # noqa: PLC0415 - the same

    kind = found.kind
    said = [f"it needs `{name}`, a text" for name in DECLARED if not isinstance(getattr(kind, name, None), str)]
    if not said and not kind.extension.startswith("."):
        said = ["its `extension` must begin with a dot"]
    return found.made(said, faults_of, ", when it was tried")
