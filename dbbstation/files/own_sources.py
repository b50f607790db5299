"""Error sources from outside the package: Python files that are named, beside the packages that are installed."""

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
    """All error sources by name: the package's, those of installed packages, those of Python files.

    Raises:
        InputError: every fault of every entry point, or else of every file: not there, not Python, no error source in it, a name
            that is taken, something that the contract asks for and that is not there or not right.
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
    """Names of the sources that come from these files."""
    own = {module_name(path) for path in files}
    return tuple(name for name, source in known.items() if type(source).__module__ in own)
