"""Every dialect by name: one file each in `dialects/`, found by looking, not by a list."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from inspect import getmembers, isabstract, isclass
from pathlib import PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING

import dbbstation.nc.dialects
from dbbstation.errors import StationError
from dbbstation.nc.dialect import Dialect

if TYPE_CHECKING:
    from collections.abc import Mapping


@cache
def known_dialects() -> Mapping[str, Dialect]:
    """All dialects of the package, sorted by name."""
    found: dict[str, Dialect] = {}
    for module in pkgutil.iter_modules(dbbstation.nc.dialects.__path__):
        content = importlib.import_module(f"dbbstation.nc.dialects.{module.name}")
        for _, member in getmembers(content, isclass):
            own = member.__module__ == content.__name__
            if own and issubclass(member, Dialect) and not isabstract(member):
                found[member.name] = member()
    return MappingProxyType(dict(sorted(found.items())))


def dialect_named(name: str) -> Dialect:
    """Return the dialect of this name.

    Raises:
        StationError: there is none.
    """
    known = known_dialects()
    if name not in known:
        raise StationError(f"no NC dialect is called {name!r}", remedy=f"known are {', '.join(known)}")
    return known[name]


def dialect_of_file(file: str) -> Dialect:
    """Return the dialect that a file's extension stands for.

    Raises:
        StationError: no dialect has that extension.
    """
    extension = PurePath(file).suffix.lower()
    for dialect in known_dialects().values():
        if dialect.extension == extension:
            return dialect
    extensions = ", ".join(f"{dialect.extension} ({name})" for name, dialect in known_dialects().items())
    raise StationError(
        f"no NC dialect has files that end with {extension!r}", where=file, remedy=f"known: {extensions}"
    )
