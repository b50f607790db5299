"""All causes of force by name: one file each in this folder, found by looking, not by a list."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from functools import cache
from inspect import getmembers, isabstract, isclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.diagnosis.drive import sources
from dbbstation.diagnosis.drive.contract import DriveSource
from dbbstation.errors import ModelError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


@cache
def known_drive_sources() -> Mapping[str, DriveSource]:
    """All causes of the package, sorted by name."""
    found: dict[str, DriveSource] = {}
    for module in pkgutil.iter_modules(sources.__path__):
        content = importlib.import_module(f"{sources.__name__}.{module.name}")
        for _, member in getmembers(content, isclass):
            own = member.__module__ == content.__name__
            if own and issubclass(member, DriveSource) and not isabstract(member):
                found[member.name] = member()
    return MappingProxyType(dict(sorted(found.items())))


def drive_sources_named(names: Iterable[str]) -> tuple[DriveSource, ...]:
    """Causes by their names.

    Raises:
        ModelError: a name that no cause has.
    """
    known = known_drive_sources()
    chosen = []
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
            remedy = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            raise ModelError(f"no cause of force in a drive is called {name!r}", remedy=remedy)
        chosen.append(known[name])
    return tuple(chosen)
