"""Every dialect by name: from `dialects/` and from installed packages."""

from __future__ import annotations

from functools import cache
from pathlib import PurePath
from types import MappingProxyType
from typing import TYPE_CHECKING

from dbbstation.catalogue import InFolders, added, installed, looked_up
from dbbstation.errors import Problem, StationError, refuse
from dbbstation.nc import dialects
from dbbstation.nc.dialect import Dialect

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dbbstation.nc.spilled import LongText

GROUP = "dbbstation.dialects"
"""Entry points of this group name classes that derive from `Dialect`."""

HOW_TO_ADD = "one of your own is given as its file, FILE.py, or its package installed"
"""Advice for an unknown dialect name."""


@cache
def known_dialects() -> Mapping[str, Dialect]:
    """Return all dialects, sorted by name.

    Raises:
        InputError: a package has a dialect that cannot be used, or whose name is taken.
    """
    faults: list[Problem] = []
    own = InFolders(Dialect, dialects)  # type: ignore[type-abstract]  # what derives from it is made
    others = installed(GROUP, Dialect, faults)  # type: ignore[type-abstract]  # what derives from it is made
    if not (others or faults):
        return own
    found, whose = dict(own), dict[str, str]()
    for other in others:
        added(found, whose, other.kind(), other.place, called="an NC dialect", faults=faults)
    refuse(faults)
    return MappingProxyType(dict(sorted(found.items())))


def dialect_named(name: str) -> Dialect:
    """Return the dialect of this name.

    Raises:
        StationError: there is none.
    """
    return looked_up(name, known_dialects(), called="NC dialect", error=StationError, how_to_add=HOW_TO_ADD)


def dialect_of_file(file: str, text: str | LongText) -> Dialect:
    """Return a program's dialect by its extension, or by its text if several dialects share the extension.

    Raises:
        StationError: no dialect has that extension, or several have it and the program does not tell them apart.
    """
    extension, known = PurePath(file).suffix.lower(), known_dialects()
    having = [dialect for dialect in known.values() if extension in (dialect.extension, *dialect.also_read)]
    if not having:
        extensions = ", ".join(f"{dialect.extension} ({name})" for name, dialect in known.items())
        raise StationError(
            f"no NC dialect has files that end with {extension!r}",
            where=file,
            remedy=f"known: {extensions}; name its language with --written-in",
        )
    fitting = having if len(having) == 1 else [dialect for dialect in having if dialect.is_in(str(text))]
    if len(fitting) != 1:
        names = ", ".join(dialect.name for dialect in fitting or having)
        raise StationError(
            f"the program may be in several NC dialects: {names}",
            where=file,
            remedy="state the dialect with --written-in",
        )
    return fitting[0]
