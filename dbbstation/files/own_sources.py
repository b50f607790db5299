"""Load error sources from Python files and installed packages."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

from dbbstation.catalogue import FoundClass
from dbbstation.errors import Problem, refuse
from dbbstation.files.own_classes import classes_in_files, module_name
from dbbstation.laws.contract import MOVING, TableSource
from dbbstation.sources.contract import ErrorSource
from dbbstation.sources.registry import known_sources, known_with

if TYPE_CHECKING:
    from abc import ABC
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
    own = classes_in_files(files, (ErrorSource, TableSource), CONTRACT, faults)
    found = known_with([_of_struts(one) for one in own if _has_columns(one, faults)], faults)
    refuse(faults)
    return found


def _has_columns(found: FoundClass[ABC], faults: list[Problem]) -> bool:
    missing = [
        name for name in getattr(found.kind, "needs", ()) if issubclass(found.kind, TableSource) and name not in MOVING
    ]
    if missing:
        fault = found.fault(f"{found.kind.__name__} needs {', '.join(missing)}, which a strut does not have")
        faults.append(replace(fault, remedy=f"a strut has {', '.join(MOVING)}"))
    return not missing


def _of_struts(found: FoundClass[ABC]) -> FoundClass[ErrorSource]:
    if not issubclass(found.kind, TableSource):
        return FoundClass(cast("type[ErrorSource]", found.kind), found.place)
    from dbbstation.sources.of_struts import of_struts  # noqa: PLC0415 - few commands are given a law over columns

    return FoundClass(of_struts(found.kind), found.place)


def sources_of(files: Sequence[Path], known: Mapping[str, ErrorSource]) -> tuple[str, ...]:
    """Return the names of sources from these files."""
    own = {module_name(path) for path in files}
    return tuple(name for name, source in known.items() if type(source).__module__ in own)
