"""Error sources from outside the package: Python files that are named, and packages that are installed."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.catalogue import Found, added, in_words, installed
from dbbstation.errors import InputError, Problem
from dbbstation.files.formats.machine import read_machine
from dbbstation.files.own_classes import classes_in_files, line_in, module_name
from dbbstation.files.shipped import shipped_folder
from dbbstation.sources.contract import ErrorSource
from dbbstation.sources.registry import known_sources
from dbbstation.sources.trial import tried, undeclared

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from dbbstation.machine.geometry import Machine

GROUP = "dbbstation.sources"
"""Entry points of this group name classes that derive from `ErrorSource`."""

CONTRACT = "see `An error source of your own` in docs/diagnosis.md"


def every_source(files: Sequence[Path] = ()) -> Mapping[str, ErrorSource]:
    """All error sources by name: the package's, those of installed packages, those of Python files.

    Args:
        files: Python files with error sources.

    Raises:
        InputError: every fault of every file and entry point: not there, not Python, no error source in it, a name
            that is taken, something that the contract asks for and that is not there or not right.
    """
    faults: list[Problem] = []
    found = dict(known_sources())
    whose: dict[str, str] = {}
    own = [*installed(GROUP, _BASE, faults), *classes_in_files(files, _BASE, CONTRACT, faults)]
    machine = read_machine(shipped_folder("fixtures") / "machines" / "every-key.yaml") if own else None
    for other in own:
        assert machine is not None  # noqa: S101 - read where there is a class to try on it
        one = _checked(other, machine, faults)
        if one is not None:
            added(found, whose, one, other.place, called="an error source", faults=faults)
    if faults:
        raise InputError(faults)
    return MappingProxyType(dict(sorted(found.items())))


_BASE: type[ErrorSource] = ErrorSource  # type: ignore[type-abstract]  # what derives from it is made


def sources_of(files: Sequence[Path], known: Mapping[str, ErrorSource]) -> tuple[str, ...]:
    """Names of the sources that come from these files."""
    own = {module_name(path) for path in files}
    return tuple(name for name, source in known.items() if type(source).__module__ in own)


def _checked(found: Found[ErrorSource], machine: Machine, faults: list[Problem]) -> ErrorSource | None:
    """Return a source made from a class; None with what it lacks added."""
    kind, place = found.kind, found.place
    said, line = undeclared(kind), place.line
    if not said:
        try:
            source = kind()
            said = tried(source, machine)
        except Exception as error:  # noqa: BLE001 - whatever the code of somebody else raises
            said = [f"{in_words(error)}, when it was tried on a circle"]
            line = line_in(error, place.file) or line
        else:
            if not said:
                return source
    faults += [Problem(place.file, line, 0, f"{kind.__name__}: {what}", found.remedy) for what in said]
    return None
