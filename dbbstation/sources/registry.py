"""Every error source by name: one file each in `causes` and `unmodelled`, found by looking, not by a list."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from functools import cache
from inspect import getmembers, isabstract, isclass
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING

from dbbstation.errors import ModelError
from dbbstation.sources import causes, unmodelled
from dbbstation.sources.contract import ErrorSource

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping


HOW_TO_ADD = "One of your own is given with --source-file FILE.py, or its package installed"
"""What a name that nobody knows may lack."""


@cache
def known_sources() -> Mapping[str, ErrorSource]:
    """All error sources of the package, sorted by name."""
    found: dict[str, ErrorSource] = {}
    modules = [name for folder in (causes, unmodelled) for name in _modules_in(folder)]
    for content in map(importlib.import_module, modules):
        for _, member in getmembers(content, isclass):
            own = member.__module__ == content.__name__
            public = own and not member.__name__.startswith("_")  # those are other forms of a source
            if public and issubclass(member, ErrorSource) and not isabstract(member):
                found[member.name] = member()
    return MappingProxyType(dict(sorted(found.items())))


def _modules_in(folder: ModuleType) -> list[str]:
    """Full names of the modules of a package."""
    return [f"{folder.__name__}.{module.name}" for module in pkgutil.iter_modules(folder.__path__)]


def sources_named(names: Iterable[str], known: Mapping[str, ErrorSource] | None = None) -> tuple[ErrorSource, ...]:
    """Sources by their names.

    Args:
        names: of the sources.
        known: every error source by name; those of the package if None.

    Raises:
        ModelError: a name that no source has.
    """
    known = known_sources() if known is None else known
    chosen = []
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
            remedy = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}."
            remedy += f" {HOW_TO_ADD}"
            raise ModelError(f"no error source is called {name!r}", remedy=remedy)
        chosen.append(known[name])
    return tuple(chosen)
