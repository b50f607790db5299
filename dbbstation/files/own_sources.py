"""Load error sources from Python files and installed packages."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dbbstation.errors import InputError, Problem
from dbbstation.files.own_classes import classes_in_files, module_name
from dbbstation.sources.contract import ErrorSource
from dbbstation.sources.registry import known_sources, known_with

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

CONTRACT = "see `An error source of your own` in docs/diagnosis.md"


def every_source(files: Sequence[Path] = ()) -> Mapping[str, ErrorSource]:
    """Return all error sources by name, from the package, from installed packages and from Python files.

    Raises:
        InputError: every fault of every entry point, or else of every file: missing, not Python, no source, a taken name, a
            missing requirement.
    """
    if not files:
        return known_sources()
    faults: list[Problem] = []
    own = classes_in_files(files, ErrorSource, CONTRACT, faults)  # type: ignore[type-abstract]  # what derives from it is made
    found = known_with(own, faults)
    if faults:
        raise InputError(faults)
    return found


def sources_of(files: Sequence[Path], known: Mapping[str, ErrorSource]) -> tuple[str, ...]:
    """Return the names of sources from these files."""
    own = {module_name(path) for path in files}
    return tuple(name for name, source in known.items() if type(source).__module__ in own)
